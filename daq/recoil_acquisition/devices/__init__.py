"""Live sources: CAN buses and serial ports that are read as they come, nothing decoded and nothing lost in silence."""
