"""CAN buses: logs of their vendors' tools, captures, bus logging, and the decoding of frames into signals."""
