"""Parts that files of channels with their samples share: the recording, stored time, and the axis of a waveform."""
