"""What every other package uses: errors, files, folders, units, quantities and random streams."""
