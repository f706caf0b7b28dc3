"""The verdict of a shot: whether every channel, and the motion that they tell of together, is usable."""
