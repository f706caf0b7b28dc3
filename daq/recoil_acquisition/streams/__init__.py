"""Streams of instruments that count their samples: bytes in, samples by tick out."""
