"""Measured trials against the simulator: where the gap lies, and what causes it."""
