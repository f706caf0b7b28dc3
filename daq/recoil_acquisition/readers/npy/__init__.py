"""NumPy arrays: their head, and the columns below it."""
