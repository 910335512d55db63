"""Bodies: meshes, elements, materials, assembly and sparse factorisation. NumPy and numba only."""
