"""Estimators of the mass where both sides of the regression carry noise, and the test whether that matters."""
