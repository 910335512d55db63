"""What laboratories write, and what is no tensile test."""

import numpy as np
import pytest

from cfem.core.errors import InputError, SpecError
from cfem.identify.material.curve import read_curve, up_to

STRAIN = np.array([0.1, 0.2, 0.4, 0.6, 0.8, 1.0])
KPA = np.array([10.0, 18.0, 30.0, 40.0, 48.0, 55.0])


def table(tmp_path, title, x=STRAIN, y=KPA, mark=",", head=""):
    path = tmp_path / "test.csv"
    rows = "".join(f"{a:g}{mark} {b:g}\n" for a, b in zip(x, y, strict=True))
    path.write_text(f"{head}{title}\n{rows}")
    return path


@pytest.mark.parametrize(
    "title, x, y, more",
    [
        ("strain, stress [kPa]", STRAIN, KPA, {}),
        ("stretch, stress [MPa]", 1 + STRAIN, KPA / 1e3, {}),
        ("Tensile strain (%), Tensile stress (Pa)", 100 * STRAIN, KPA * 1e3, {}),
        ("strain (mm/mm), stress (kPa)", STRAIN, KPA, {}),
        ("Extension (mm), Load (N)", 33 * STRAIN, 18 * KPA / 1e3, {"length": 33.0, "area": 18.0}),
        ("displacement [cm], force [mN]", 3.3 * STRAIN, 18 * KPA, {"length": 33.0, "area": 18.0}),
    ],
)
def test_columns_and_units(tmp_path, title, x, y, more):
    curve = read_curve(table(tmp_path, title, x, y), **more)
    np.testing.assert_allclose(curve.stretch, 1 + STRAIN, rtol=1e-12)
    np.testing.assert_allclose(curve.stress, KPA / 1e3, rtol=1e-12)


def test_lines_of_a_machine_above_the_titles_and_true_stress_beside_engineering(tmp_path):
    path = tmp_path / "machine.csv"
    rows = "".join(
        f"{i};{np.log1p(e)};{s * (1 + e)};{e};{s}\n" for i, (e, s) in enumerate(zip(STRAIN, KPA / 1e3, strict=True))
    )
    titles = "Time (s);True Strain;True Stress (MPa);Engineering Strain;Engineering Stress (MPa)\n"
    path.write_text("Speed (mm/min);450;;;\nStandard;ASTM D412;;;\n;;;;\n# a comment\n" + titles + rows)
    curve = read_curve(path)
    np.testing.assert_allclose(curve.stretch, 1 + STRAIN)
    np.testing.assert_allclose(curve.stress, KPA / 1e3)


def test_part_of_a_curve(tmp_path):
    curve = read_curve(table(tmp_path, "strain, stress [kPa]"))
    assert up_to(curve, 2.0).stretch.max() == 2.0
    with pytest.raises(SpecError, match=r"4 points up to a stretch of 1.7, and a fit needs 6 \(raise --up-to\)"):
        up_to(curve, 1.7)


BAD = {
    "no titles": ("0, 0", STRAIN, KPA, "has no titles such as 'strain, stress"),
    "no unit of stress": ("strain, stress", STRAIN, KPA, r"'stress': has no unit \(write 'stress \[MPa\]'\)"),
    "no unit of extension": ("extension, stress [kPa]", STRAIN, KPA, "'extension': has no unit"),
    "wrong unit": ("strain, stress [mm]", STRAIN, KPA, "'stress .mm.': .*mm.* is not a unit of"),
    "strain in mm": ("strain [mm], stress [kPa]", STRAIN, KPA, "strain is a plain number or in %"),
    "per cent in disguise": ("strain, stress [kPa]", 100 * STRAIN, KPA, r"a strain of 100 without a unit"),
    "stretch of zero": ("stretch, stress [kPa]", STRAIN - 0.1, KPA, "a specimen keeps a length above zero"),
    "two of a kind": ("strain, strain 2, stress [kPa]", STRAIN, KPA, "columns 'strain' and 'strain 2' describe"),
    "few": ("strain, stress [kPa]", STRAIN[:5], KPA[:5], "holds 5 points, and a fit needs 6"),
    "not a number": (
        "strain, stress [kPa]",
        STRAIN,
        [*KPA[:5], np.nan],
        r"test.csv:7: column 'stress .kPa.': is empty",
    ),
    "unloading": (
        "strain, stress [kPa]",
        [*STRAIN, 0.5],
        [*KPA, 30.0],
        r"the stretch falls from line 8 on",
    ),
    "falling": ("strain, stress [kPa]", STRAIN, -KPA, "stress does not rise with stretch"),
    "no stress": ("strain, stress [kPa]", STRAIN, 0 * KPA, "stress does not rise with stretch"),
    "compression above zero": (
        "compressive strain, compressive stress [kPa]",
        STRAIN,
        KPA,
        "'compressive strain': values above zero would be read as tension .write strains and stresses of compression",
    ),
    "one stretch": ("strain, stress [kPa]", 0 * STRAIN + 0.1, KPA, "holds one stretch only"),
}


@pytest.mark.parametrize("title, x, y, part", BAD.values(), ids=BAD.keys())
def test_what_is_no_tensile_test_is_refused(tmp_path, title, x, y, part):
    with pytest.raises(InputError, match=part):
        read_curve(table(tmp_path, title, x, y), length=33.0)


def test_a_test_from_compression_to_tension_is_one_loading(tmp_path):
    stretch = np.array([0.5, 0.6, 0.8, 0.95, 1.0, 1.1, 1.5, 2.0])
    curve = read_curve(table(tmp_path, "stretch, stress [kPa]", stretch, 100 * (stretch - stretch**-2)))
    np.testing.assert_allclose(curve.stretch, stretch)
    assert curve.sense == "compression and tension"
    assert read_curve(table(tmp_path, "strain, stress [kPa]")).sense == "tension"


def test_a_comma_between_thousands_is_never_a_decimal_comma(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text(
        "strain;stress [Pa]\n" + "".join(f"{e:g};{1e3 * s:,.0f}\n" for e, s in zip(STRAIN, KPA, strict=True))
    )
    with pytest.raises(InputError, match=r"test.csv:2: column 'stress \[Pa\]': '10,000' has a comma where '0.1' has"):
        read_curve(path)


def test_what_is_no_table_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_curve(tmp_path / "none.csv")
    picture = tmp_path / "test.png"
    picture.write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(InputError, match="is not a text file in UTF-8"):
        read_curve(picture)
    with pytest.raises(InputError, match=r"'0\.1 mm' is not a number"):
        path = table(tmp_path, "strain, stress [kPa]")
        path.write_text(path.read_text().replace("0.1,", "0.1 mm,"))
        read_curve(path)
    with pytest.raises(SpecError, match=r"needs the specimen's area of the section at rest \(give --area '18 mm\^2'\)"):
        read_curve(table(tmp_path, "strain, force [N]"))
