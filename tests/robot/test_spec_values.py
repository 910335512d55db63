"""Whatever stands in a scene, it is a scene or one sentence with the file and the key."""

import copy
import math

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.robot.spec import SceneSpec

UNITS = ["mm", "m", "kPa", "MPa", "kg/m^3", "deg", "m/s^2", "N", "", "1_0", "%", "mm^3"]
QUANTITY = st.builds("{} {}".format, st.one_of(st.floats(), st.integers(-9, 9)), st.sampled_from(UNITS))
SIMPLE = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=8), QUANTITY)
VALUE = st.recursive(
    SIMPLE,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3), st.dictionaries(st.sampled_from([*UNITS, "kind", "name"]), inner, max_size=2)
    ),
    max_leaves=5,
)
SCENE = {
    "name": "own",
    "out": "mesh",
    "length": "30 mm",
    "geometry": {"kind": "bar", "length": "30 mm", "width": "10 mm", "height": "10 mm"},
    "mesh": {"size": "5 mm", "element": "tet4"},
    "material": {"young": "1 MPa", "poisson": 0.3, "density": "1070 kg/m^3"},
    "gravity": {"acceleration": {"m/s^2": [0, 0, -9.81]}},
    "fixed": [{"kind": "plane", "point": {"mm": [0, 0, 0]}, "normal": [-1, 0, 0]}],
    "actuators": [
        {"kind": "cable", "name": "c", "points": {"mm": [[5, 0, 0], [25, 0, 0]]}, "reach": {"mm": [0, 3]}},
        {
            "kind": "cavity",
            "name": "v",
            "inside": {"mm": [5, 0, 0]},
            "reach": {"mm^3": [0, 3]},
            "pressure": {"kPa": [0, 9]},
        },
    ],
    "effectors": [{"name": "tip", "point": {"mm": [29, 0, 0]}}],
}


def places(data, path=()):
    """Paths of all values in plain data."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield (*path, key)
        yield from places(value, (*path, key))


def numbers(data):
    if isinstance(data, dict | list):
        for value in data.values() if isinstance(data, dict) else data:
            yield from numbers(value)
    elif isinstance(data, float):
        yield data


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(list(places(SCENE))), VALUE)
def test_any_value_at_any_key_is_a_scene_or_one_sentence(tmp_path, path, value):
    data = copy.deepcopy(SCENE)
    *above, last = path
    inner = data
    for key in above:
        inner = inner[key]
    inner[last] = value
    file = tmp_path / "scene.yaml"
    YAML().dump(data, file)
    try:
        scene = load_spec(file, SceneSpec)
    except SpecError as error:
        assert "scene.yaml" in str(error) and len(str(error).splitlines()) == 1
    else:
        assert all(math.isfinite(one) for one in numbers(scene.model_dump(mode="python")))
