"""Whether a scene can be meant: sizes, strokes, cable routes, soundness of the mesh."""
