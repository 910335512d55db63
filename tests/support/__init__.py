"""Small exact building blocks that several test packages share."""
