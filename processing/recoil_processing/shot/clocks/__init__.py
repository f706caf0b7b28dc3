"""The clocks of a shot's sources, found by the motion and by the forces."""
