"""One shot as a whole: its signals on one grid, the clocks of its sources, and the verdict whether it is usable."""
