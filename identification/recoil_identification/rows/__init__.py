"""The rows that a shot gives to compare with each other: equation of motion, camera, gauges; and what may be wrong."""
