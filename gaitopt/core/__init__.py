"""What every other part stands on: errors, files, units and quantities."""
