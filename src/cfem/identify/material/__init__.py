"""Laws of rubber from tensile tests: curves, the laws that fit them, and how far each law is stable."""
