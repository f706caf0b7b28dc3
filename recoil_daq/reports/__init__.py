"""Shot files in, reports out."""
