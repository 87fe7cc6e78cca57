"""Sealed cases: made, and scored."""
