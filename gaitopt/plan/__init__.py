"""The reduced planar model, and the gaits that are planned with it."""
