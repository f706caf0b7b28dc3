"""Recorded files to the draft of a rig file: what the files and the shot tell, and what only a person knows."""
