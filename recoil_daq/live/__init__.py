"""Armed acquisition at the range: a session and its shots, its screen, its devices, and what a crash left over."""
