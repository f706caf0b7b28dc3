"""The propellant's force from the motion."""
