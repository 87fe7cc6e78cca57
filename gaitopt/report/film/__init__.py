"""Films of a robot that moves."""
