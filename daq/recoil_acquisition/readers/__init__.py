"""Readers of the instruments' own formats: one package per family, one module per format, one table, one protocol."""
