"""The robot in three dimensions on a page: its shapes, and its motion as recorded."""
