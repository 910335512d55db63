"""The fit that all identifications share: least squares, intervals, and what the measurements cannot tell."""
