"""Files or devices in, shot files out."""
