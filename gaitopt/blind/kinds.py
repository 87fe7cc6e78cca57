"""Kinds of blind cases; by themselves, because the command line names them before anything is loaded."""

KINDS = ("single", "none", "outside", "pair")
"""One effect, none, a disturbance outside the library, two effects."""
