"""gaitopt: optimal gaits for small crawling robots, from a MuJoCo model to the servos."""
