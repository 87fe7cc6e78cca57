"""Effects fitted to trials."""
