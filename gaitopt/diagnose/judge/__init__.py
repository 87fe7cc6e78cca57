"""What the fits say: which cause, how sure, what to measure next."""
