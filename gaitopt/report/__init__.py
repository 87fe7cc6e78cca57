"""Pages, figures and films."""
