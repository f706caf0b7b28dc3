"""A shot on its rig: put together from recordings, corrected, with what was assumed of it."""
