"""Text for a person at a terminal: progress, numbers, lines."""
