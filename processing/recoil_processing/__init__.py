"""From recorded to usable: filters, clocks, derivatives and the checks that say whether to trust them.

Functions here take and return plain arrays with units in their names; they know no rig and no mass.
"""
