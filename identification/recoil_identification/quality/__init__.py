"""Whether a shot can be used: the checks wired to its channels."""
