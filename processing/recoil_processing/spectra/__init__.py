"""Spectra, and the cut-off that they show."""
