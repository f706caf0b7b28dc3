"""Shots after the trigger: their conversion, their mass, and the files that are dropped beside them."""
