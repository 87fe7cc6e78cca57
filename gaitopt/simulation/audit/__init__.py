"""The checks of a model, one kind a file."""
