"""What is measured of a body of which only the shape is known: its inside, sections, flat ends and voxels."""
