"""Arrays, how they are kept and calculated with."""
