"""Whether one constant mass explains a shot."""
