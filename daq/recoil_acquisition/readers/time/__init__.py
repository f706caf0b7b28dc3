"""Time as several families of readers share it: wall clocks, printed decimals, stamps that repeat."""
