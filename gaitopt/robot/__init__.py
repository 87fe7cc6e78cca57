"""What is said of any robot: roles, and named series over time."""
