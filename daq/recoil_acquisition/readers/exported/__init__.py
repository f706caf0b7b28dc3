"""Files that this project exports, CSV and Parquet, read back."""
