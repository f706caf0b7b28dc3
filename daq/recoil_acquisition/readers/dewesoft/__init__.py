"""Dewesoft's own recordings (.dxd, .d7d), by the vendor's library."""
