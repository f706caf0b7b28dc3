"""Quantities and their units, and what a person declares of them."""
