"""What `gaitopt new` reads of a robot's MJCF, asks MuJoCo, and guesses."""
