"""Gait tables and players for servo boards: checked, replayed in simulation, then written."""
