"""Readers of the instruments' own formats: one module per format, one table, one protocol."""
