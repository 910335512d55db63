"""The bodies of the catalogue, a file each: its spec of a few lengths, and its solid."""
