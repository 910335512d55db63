"""A soft bar along x, clamped at its end at 0, that one cable on its upper side bends."""


def bar_scene(size: float, element: str, poisson: float) -> str:
    """Text of its scene.yaml; size: of the mesh, mm."""
    return f"""
name: bar
out: mesh
length: 60 mm
geometry: {{kind: bar, length: 60 mm, width: 10 mm, height: 10 mm}}
mesh: {{size: {size:g} mm, element: {element}}}
material: {{law: neo-hookean, young: 1 MPa, poisson: {poisson:g}}}
fixed: [{{kind: plane, point: {{mm: [1, 0, 0]}}, normal: [-1, 0, 0]}}]
actuators:
  - kind: cable
    name: up
    points: {{mm: [[15, 0, 3], [35, 0, 3], [55, 0, 3]]}}
    pull_point: {{mm: [0, 0, 3]}}
    reach: {{mm: [0, 4]}}
effectors: [{{name: tip, point: {{mm: [58, 0, 0]}}}}]
"""
