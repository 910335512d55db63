"""A small scene, the bar, as text to which a test adds what it is about."""

from cfem.core.spec import load_spec
from cfem.robot.spec import SceneSpec

BASE = {
    "name": "own",
    "out": "mesh",
    "length": "30 mm",
    "geometry": "{kind: bar, length: 30 mm, width: 10 mm, height: 10 mm}",
    "mesh": "{size: 5 mm, element: tet4}",
    "material": "{young: 1 MPa, poisson: 0.3}",
    "fixed": "[{kind: plane, point: {mm: [0, 0, 0]}, normal: [-1, 0, 0]}]",
    "actuators": "[{kind: cable, name: c, points: {mm: [[5, 0, 0], [25, 0, 0]]}, reach: {mm: [0, 3]}}]",
    "effectors": "[{name: tip, point: {mm: [29, 0, 0]}}]",
}


def scene(folder, **changes) -> SceneSpec:
    """The bar's scene with keys put in or (None) left out, each value as YAML on one line."""
    path = folder / "scene.yaml"
    lines = [f"{key}: {value}\n" for key, value in (BASE | changes).items() if value is not None]
    path.write_text("".join(lines))
    return load_spec(path, SceneSpec)
