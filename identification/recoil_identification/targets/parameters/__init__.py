"""Masses, first moments and inertias from all five equations of motion, and the inertia forces that follow."""
