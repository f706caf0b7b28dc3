"""Framing without input or output: bytes in, frames out. Live ports, captures and tests share it."""
