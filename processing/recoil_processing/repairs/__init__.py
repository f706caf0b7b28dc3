"""Damage that instruments do to samples, found and mended."""
