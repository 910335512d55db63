"""C exports compiled on this machine, as Python objects."""
