"""The effects, one file for each part of the robot that they act on."""
