"""DEWETRON OXYGEN's own recordings (.dmd)."""
