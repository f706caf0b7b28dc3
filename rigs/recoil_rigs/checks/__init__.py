"""Faults of a rig file that are found beyond its single values."""
