"""What is common to all robots: roles, signals, trajectories, and MuJoCo's own rules."""
