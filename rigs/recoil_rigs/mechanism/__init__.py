"""The mechanism: its parameters, the equations of its motion, what an accelerometer on it feels, its tube."""
