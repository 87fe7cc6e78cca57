"""Kinds of blind cases; in a separate file, so that the command line loads nothing else to name them."""

KINDS = ("single", "none", "outside", "pair", "several")
"""One effect, none, a disturbance outside the library, two effects; one to four on a robot that is a little
wrong in everything else, too."""
