"""The command line."""

from gaitopt.cli.app import build_parser, main

__all__ = ["build_parser", "main"]
