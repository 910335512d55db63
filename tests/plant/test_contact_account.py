"""What plants tell of contact."""

import pytest

from cfem.contact.law.modes import Mode
from cfem.plant.contact_account import ContactAccount


def told(deepest=0.0):
    account = ContactAccount()
    account.seen([Mode.STICK, Mode.OPEN, Mode.STICK], 1e-9)
    account.seen([Mode.SLIP], 5e-10)
    account.commands, account.failures, account.steps, account.iterations = 4, 1, 9, 30
    account.deepest = (deepest, "wall")
    return account


def test_points_of_all_commands_are_counted_and_the_worst_residual_kept():
    assert told().account() == {
        "commands": 4,
        "failures": 1,
        "points": {"open": 1, "stick": 2, "slip": 1},
        "steps": 9,
        "iterations": 30,
        "law_residual": 1e-9,
        "deepest": 0.0,
    }


def test_the_sentence_says_so():
    text = told(0.5).sentence()
    assert text.startswith(
        "contact: 3 of 4 commands carried out; contact points at their ends: 1 open, 2 stick, 1 slip"
    )
    assert "9 quasi-static steps, 30 rounds of FE; the law is met to 1.0e-09" in text
    assert text.endswith("between patches the surface reaches up to 0.5 mm into wall")
    assert "between patches" not in told(1e-4).sentence()


@pytest.mark.parametrize(("depth", "count"), [(0.59, 0), (0.61, 1)])
def test_a_surface_a_hundredth_of_the_length_within_something_is_poor(depth, count):
    found = told(depth).judged(60.0)
    assert len(found) == count and all("0.61 mm into wall" in one["what"] for one in found)


def test_another_robot_that_overlaps_itself_is_named_since_nobody_can_say_how_deep():
    account = told(0.7)
    account.unjudged |= {"twin"}
    unknown, deep = account.judged(60.0)
    assert "surface of twin overlaps itself" in unknown["what"] and "into wall" in deep["what"]
