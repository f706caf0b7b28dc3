"""Stiffness and damping of what carries the mechanism: elevating gear and ground."""
