"""Gait tables and players for servo boards, replayed in simulation first."""
