"""Kinds of blind cases; in a separate file, so that the command line loads nothing else to name them."""

KINDS = ("single", "none", "outside", "pair")
"""One effect, none, a disturbance outside the library, two effects."""
