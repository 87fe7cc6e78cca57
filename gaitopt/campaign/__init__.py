"""A campaign: film a gait of the real robot, learn from the film, and choose the next one."""
