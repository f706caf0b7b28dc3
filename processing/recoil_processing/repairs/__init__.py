"""What instruments do to samples, found and mended."""
