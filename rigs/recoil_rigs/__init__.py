"""The rig: what was plugged in where, the mechanism it tests, and the virtual rig."""
