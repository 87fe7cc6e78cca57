"""What every other package uses: errors, files, units and random streams."""
