"""Captures of serial ports."""
