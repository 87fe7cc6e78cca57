"""Measured beside simulated: how far apart, and where."""
