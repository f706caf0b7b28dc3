"""Displacement, velocity and acceleration, from one another and together."""
