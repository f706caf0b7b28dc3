"""Many shots of a rig: what they come from, their one answer, and what a day of them is expected to tell."""
