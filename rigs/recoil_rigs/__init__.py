"""What was plugged in where: the rig, the mechanism it tests, and the virtual rig."""
