"""Commands in, trajectories, metrics and findings out."""
