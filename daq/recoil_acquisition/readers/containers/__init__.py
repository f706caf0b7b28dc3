"""Parts that files of channels with their samples share: the recording and stored time."""
