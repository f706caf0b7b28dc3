"""The verdict of a shot: whether every channel, and the motion that they measured together, is usable."""
