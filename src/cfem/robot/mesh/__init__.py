"""From a geometry to its mesh: gmsh in a process of its own, blocks of hexahedra, mesh files; grading and quality."""
