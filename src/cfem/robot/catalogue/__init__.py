"""The robots of the catalogue: the solid of each from a few lengths."""
