"""Bodies: meshes, elements, materials, assembly and sparse factorisation. NumPy and numba only."""

from pathlib import Path

from cfem.core.cache import place_compiled_code

place_compiled_code(Path(__file__).parent)
