"""Autoregressive models with an exogenous input, from their orders to the page that a user of such models knows."""
