"""Closed surfaces of triangles: distances, sides, edges that cross, and how deep a body overlaps itself."""
