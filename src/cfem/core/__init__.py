"""What every stage shares: errors, units, specs, files, progress. No science."""
