"""Packages beside this one: libraries that it needs and those that add to it."""
