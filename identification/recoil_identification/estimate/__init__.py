"""The mass as a number: its estimates, the budget of its uncertainty, RPE, Monte Carlo."""
