"""Clocks: time bases of channels, fits of a clock to the host's, its breaks, and what several clocks share."""
