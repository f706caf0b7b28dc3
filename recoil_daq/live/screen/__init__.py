"""The armed screen, and the plain log where there is none."""
