"""Inequalities in words of the parameters, and nothing else."""

import numpy as np
import pytest

from cfem.core.errors import SpecError
from cfem.design.expression import inequality, names_in

VALUES = {"H": np.array([20.0, 22.0]), "JH": np.array([5.0, 10.0])}


@pytest.mark.parametrize(
    ("text", "slack"),
    [
        ("H - JH >= 13", [2.0, -1.0]),
        ("H <= 21", [1.0, -1.0]),
        ("2 * sqrt(H**2) / 2 >= -JH + 26", [-1.0, 6.0]),
        ("max(H, JH) - abs(-pi) >= 0", [20 - np.pi, 22 - np.pi]),
    ],
)
def test_slack_is_positive_where_it_holds(text, slack):
    assert inequality(text, VALUES, "here")(VALUES) == pytest.approx(np.array(slack))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("H - JH", "not an inequality"),
        ("H >", "not an inequality"),
        ("H >= 3 mm", "numbers without units"),
        ("1 <= H <= 3", "not an inequality"),
        ("H == 3", "not an inequality"),
        ("K >= 3", "unknown name 'K'.*known are H, JH"),
        ("H.real >= 3", "is not allowed"),
        ("__import__('os') >= 3", "is not allowed"),
        ("open('x') >= 3", "is not allowed"),
        ("min(H) >= 3", "min takes 2 numbers"),
        ("True >= H", "is not allowed"),
    ],
)
def test_anything_else_is_refused(text, message):
    with pytest.raises(SpecError, match=f"constraints.a: .*{message}"):
        inequality(text, VALUES, "constraints.a")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("H >= 1 / 0", "'H >= 1 / 0' has no finite value at H 20"),
        ("1 / (H - 22) <= JH", "has no finite value at .*H 22"),
        ("sqrt(JH - H) <= 1", "no finite value"),
        ("9**9**9**9 >= 1", "no finite value"),
    ],
)
def test_what_is_no_finite_number_is_said_with_the_design(text, message):
    with pytest.raises(SpecError, match=f"constraints.a: .*{message}"):
        inequality(text, VALUES, "constraints.a")(VALUES)


def test_names():
    assert names_in("volume + H <= 3") == {"volume", "H"} and names_in("H >") == set()
