"""MDF 4 files of measured channels, and their blocks."""
