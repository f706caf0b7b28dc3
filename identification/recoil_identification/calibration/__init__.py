"""Mass and errors of the sensors together: methods as lists of rows, their solution, the mass over time."""
