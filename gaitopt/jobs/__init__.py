"""Jobs: each done from start to end in one place, for the command line and for scripts alike."""
