"""The command from a curve to a scene; its files; its errors; what the table says of itself."""

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from support.fast_cases import fast_are
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.identify.material.stage import Request, fit_material
from cfem.robot.elastomers import ELASTOMERS
from cfem.robot.materials import read_material
from cfem.robot.spec import SceneSpec

ROOT = Path(__file__).parents[3]
CURVE = ROOT / "examples" / "tensile" / "soft-rubber.csv"


def cfem(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def test_the_rubber_that_made_the_curve_is_found():
    """Constants as the head of the file states them."""
    found = fit_material(Request({"uniaxial": CURVE}, most=3.0, slack=True, law="yeoh-2"))["material"]
    made = read_material({"law": "yeoh", "c1": "8 kPa", "c2": "0.08 kPa", "poisson": 0.499})
    assert read_material(found).young == pytest.approx(made.young, rel=0.01)
    assert read_material(found).shape == pytest.approx(made.shape, rel=0.03)


def test_its_law_is_chosen_and_a_scene_takes_what_is_written(tmp_path):
    out = tmp_path / "fit"
    done = cfem("material", "fit", CURVE, "--up-to", 3, "--slack", "--out", out)
    assert done.exit_code == 0, done.stderr
    assert "* yeoh-2" in done.stdout and "was not measured: there the law is a guess" in done.stdout
    assert done.stdout.rstrip().splitlines()[-1] == (out / "material.yaml").read_text().splitlines()[-1]
    scene = tmp_path / "scene.yaml"
    bar = (ROOT / "pipelines" / "bar" / "scene.yaml").read_text().splitlines()
    kept = "\n".join(line for line in bar if not line.startswith("material:"))
    scene.write_text(f"{kept}\n{(out / 'material.yaml').read_text()}")
    found = json.loads((out / "fit.json").read_text())
    assert load_spec(scene, SceneSpec).material.young == pytest.approx(found["young MPa"][0], rel=1e-3)
    assert found["law"] == "yeoh-2" and found["young MPa"][1] > 0 and 0 < found["slack"][0] < 0.05
    assert (out / "fit.png").read_bytes()[:4] == b"\x89PNG"
    again = cfem("material", "fit", CURVE, "--law", "yeoh-2", "--out", out)
    assert again.exit_code == 6 and "holds material.yaml, fit.json, fit.png" in again.stderr


@pytest.mark.parametrize(
    "points, mode, end",
    fast_are(
        [(6, "uniaxial", 0.05), (6, "planar", 0.95), (6, "biaxial", 0.5)],
        product([6, 30], ["uniaxial", "planar", "biaxial"], [0.95, 0.5, 0.05]),
    ),
)
def test_a_specimen_may_be_compressed(tmp_path, end, mode, points):
    """A neo-Hookean rubber of 300 kPa; the search of exponents passes zero, where a term bears nothing."""
    stretch, path = np.linspace(1.0, end, points), tmp_path / "pressed.csv"
    power = {"uniaxial": -2, "planar": -3, "biaxial": -5}[mode]
    rows = [f"{one:.12g},{0.1 * (one - one**power):.12g}\n" for one in stretch]
    path.write_text("stretch,stress [MPa]\n" + "".join(rows))
    found = fit_material(Request({mode: path}, out=tmp_path / "fit"))
    assert found["young MPa"][0] == pytest.approx(0.3, rel=1e-3) and not found["judgement"]
    assert found["curves"][0]["sense"] == "compression" and found["curves"][0]["largest stress MPa"] < 0
    with pytest.raises(SpecError, match="pulled taut"):
        fit_material(Request({"uniaxial": path}, slack=True))


def test_force_is_divided_by_the_section_that_is_given(tmp_path):
    path = tmp_path / "force.csv"
    stretch = np.linspace(1.0, 2.0, 20)
    path.write_text("extension [mm],load [N]\n" + "".join(f"{33 * (x - 1)},{1.8 * (x - x**-2)}\n" for x in stretch))
    found = fit_material(Request({"uniaxial": path}, length="33 mm", area="0.18 cm^2", law="neo-hookean"))
    assert found["young MPa"][0] == pytest.approx(0.3, rel=1e-6)


@pytest.mark.parametrize("unit, young, said", [("MPa", 45.8e3, "45.8 GPa"), ("kPa", 0.046, "46 Pa")])
def test_a_unit_that_no_rubber_has_is_doubted_by_name(tmp_path, unit, young, said):
    """Of a rubber of 45.8 kPa, Pa titled MPa; of one of 46 kPa, MPa titled kPa."""
    stretch, path = np.linspace(1.0, 2.0, 20), tmp_path / "wrong.csv"
    rows = "".join(f"{x},{young / 3 * (x - x**-2)}\n" for x in stretch)
    path.write_text(f"stretch,stress [{unit}]\n" + rows)
    done = cfem("material", "fit", path, "--law", "neo-hookean")
    first = done.stdout.splitlines()[0]
    assert first.startswith(f"POOR: Young's modulus is {said}, and 1 kPa to 1 GPa") and f"'stress [{unit}]'" in first


@pytest.mark.parametrize("unit, peak, said", [
    ("MPa", 1.0, "the stress reaches 525 MPa, and no rubber bears more than about 100 MPa"),
    ("kPa", 100.0, "misses the curve by"),
])  # fmt: skip
def test_a_stress_that_no_rubber_bears_and_a_point_that_is_not_of_the_curve_are_doubted(tmp_path, unit, peak, said):
    """kPa titled MPa, of a rubber of 900 kPa; one of 20 points a hundred times too large."""
    stretch, path = np.linspace(1.0, 2.0, 20), tmp_path / "wrong.csv"
    stress = 300 * (stretch - stretch**-2)
    stress[10] *= peak
    path.write_text(f"stretch,stress [{unit}]\n" + "".join(f"{x},{y}\n" for x, y in zip(stretch, stress, strict=True)))
    done = cfem("material", "fit", path, "--law", "neo-hookean")
    first = done.stdout.splitlines()[0]
    assert first.startswith("POOR: ") and said in first


def test_list_and_show():
    listed = cfem("material", "list")
    assert listed.exit_code == 0 and all(name in listed.stdout for name in ELASTOMERS)
    shown = cfem("material", "show", "ecoflex-00-30")
    assert "10.1089/soro.2019.0115" in shown.stdout and "ODbL" in shown.stdout and "Otherwise: 68.9 kPa" in shown.stdout
    told = json.loads(cfem("material", "show", "elastosil-m4601", "--json").stdout)
    assert told["young MPa"] == pytest.approx(2 * 0.22 * 1.499) and not told["fitted"]


@pytest.mark.parametrize("name", ELASTOMERS)
def test_every_elastomer_says_where_its_numbers_are_from(name):
    one = ELASTOMERS[name]
    assert one.source and one.density_source and one.caution and read_material({"name": name}).density > 0


BAD = {
    "no action": (["cook"], 2, "expected one of list, show, fit, got 'cook'"),
    "no name": (["show"], 2, "needs the name of an elastomer"),
    "a name nobody knows": (
        ["show", "ecoflex30"],
        2,
        "no elastomer is called 'ecoflex30' (did you mean 'ecoflex-00-30'?)",
    ),
    "no file": (["fit"], 2, "needs the table of a tensile test"),
    "a file that is not there": (["fit", "none.csv"], 3, "none.csv: no such file"),
    "a law nobody knows": (["fit", CURVE, "--law", "gent"], 2, "no law is called 'gent'"),
    "incompressible": (["fit", CURVE, "--poisson", "0.5"], 2, "from 0 to 0.4999"),
    "wrong unit": (["fit", CURVE, "--length", "3 kPa"], 2, "--length"),
    "a list of one": (["list", "ecoflex-00-30"], 2, "use `cfem material show ecoflex-00-30`"),
    "slack of a planar test": (
        ["fit", "--planar", CURVE, "--slack"],
        2,
        "needs a uniaxial test",
    ),
}


@pytest.mark.parametrize("words, code, part", BAD.values(), ids=BAD.keys())
def test_bad_input_is_one_sentence(words, code, part):
    done = cfem("material", *words)
    said = [line for line in done.stderr.strip().splitlines() if "so far" not in line]  # progress of a busy machine
    assert done.exit_code == code and part in done.stderr and len(said) == 1
