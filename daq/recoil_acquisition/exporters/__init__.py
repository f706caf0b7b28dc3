"""A shot in other programs' formats: one module per format, one protocol, one way of writing.

What a format cannot hold is listed, never dropped in silence; what was written is read back and compared
before it gets its name.
"""
