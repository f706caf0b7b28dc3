"""WAVE sound files and their chunks."""
