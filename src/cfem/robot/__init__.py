"""From scene.yaml to a meshed robot: spec, geometry, mesh, selections; then bodies and constraints."""
