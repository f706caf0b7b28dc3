"""The law of the recoil resistance, and the balances of a shot."""
