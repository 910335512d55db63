import pytest

from cfem.core.console.shown import counted, duration, folded, length, size, stress


@pytest.mark.parametrize(
    "seconds, text",
    [(1.5e-4, "150 µs"), (1.500779, "1.5 s"), (0.0203, "20.3 ms"), (0.0, "0 s"), (600, "10 min"), (9294, "2.58 h")],
)
def test_a_time_has_the_unit_that_suits_it(seconds, text):
    assert duration(seconds) == text


@pytest.mark.parametrize(
    "mm, text",
    [(0.00044, "0.44 µm"), (1.5e-6, "1.5 nm"), (0.35, "0.35 mm"), (12.345, "12.3 mm"), (0.0, "0 mm"), (2e4, "20 m"),
     (120.0, "120 mm"),
     (0.02, "20 µm"), (-7.25, "-7.25 mm"), (2e-8, "< 1 nm"), (-4.29e-9, "< 1 nm")],
)  # fmt: skip
def test_a_length_has_the_unit_that_suits_it(mm, text):
    assert length(mm) == text


@pytest.mark.parametrize(
    "mpa, text",
    [(0.0222, "22.2 kPa"), (3.0, "3 MPa"), (45.8e3, "45.8 GPa"), (46e-6, "46 Pa"), (0.0, "0 kPa"), (-0.35, "-350 kPa"),
     (3e-4, "0.3 kPa")],
)  # fmt: skip
def test_a_stress_has_the_unit_that_suits_it(mpa, text):
    assert stress(mpa) == text


@pytest.mark.parametrize("count, text", [(2168, "2.17 kB"), (14, "14 bytes"), (1.9e9, "1.9 GB"), (999_999, "1000 kB")])
def test_a_size_has_the_unit_that_suits_it(count, text):
    assert size(count) == text


def test_a_long_line_is_folded_between_words_and_a_number_stays_with_its_unit(monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    line = "  the tip moves by at most 1.25 mm in 3 of 40 states, on the model's own mesh"
    parts = folded(line)
    assert " ".join(part.strip() for part in parts) == line.strip() and max(map(len, parts)) <= 30
    assert any("1.25 mm" in part for part in parts) and all(part.startswith("    ") for part in parts[1:])
    assert folded("short") == ["short"]


def test_one_thing_is_singular():
    assert [counted(number, "edge") for number in (0, 1, 2)] == ["0 edges", "1 edge", "2 edges"]
    assert [counted(number, "body is", "bodies are") for number in (1, 3)] == ["1 body is", "3 bodies are"]
