"""MDF 2 and 3 files of measured channels, and their blocks."""
