"""One clock for all: what one clock is to another, by motion, by edges and by channels that repeat each other."""
