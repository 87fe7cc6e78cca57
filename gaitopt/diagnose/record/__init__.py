"""Measured trials: read, imported, cleaned."""
