"""Parts that files of channels with their samples share: the recording, stored time, and what is said of it."""
