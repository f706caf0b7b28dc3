"""What several families of readers share about time: wall clocks, printed decimals, stamps that repeat."""
