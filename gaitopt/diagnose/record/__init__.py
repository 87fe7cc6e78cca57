"""Measured trials: read, imported and cleaned."""
