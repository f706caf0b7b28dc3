"""Ringing of the mechanism after a blow, and how much of it is in a record."""
