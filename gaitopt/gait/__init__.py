"""What is commanded over time: gaits, their space, servos and tables."""
