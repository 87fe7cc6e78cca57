"""Measured and simulated trials compared: how far apart they are, and where."""
