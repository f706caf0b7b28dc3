"""From aligned recordings to a mass: regression, limited memory, uncertainty, report."""
