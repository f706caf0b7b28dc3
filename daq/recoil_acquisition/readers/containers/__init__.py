"""What files that hold channels with their samples share: the recording and stored time."""
