"""Documents made again from what they rest on, and whether each number comes again."""
