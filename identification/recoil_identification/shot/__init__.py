"""One shot, from its signals to its mass and the verdict on it."""
