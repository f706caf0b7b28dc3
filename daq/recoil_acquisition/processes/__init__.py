"""Processes beside this one, and what they may take."""
