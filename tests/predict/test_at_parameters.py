"""A learned model at parameters of its own."""

import copy
import pickle

import numpy as np
import pytest

from cfem.predict.at_parameters import AtParameters


class Recorder:
    """Says what it was asked."""

    rows, form, meta, domain = "rows", "force", "meta", "domain"

    def at_displacement(self, *asked):
        return "at_displacement", *asked

    def at_force(self, *asked):
        return "at_force", *asked

    def inside(self, *asked):
        return "inside", *asked

    def distance(self, *asked):
        return "distance", *asked

    def error(self, *asked):
        return "error", *asked


def test_a_model_is_asked_at_its_own_parameters():
    p = np.array([1.0, 2.0])
    model = AtParameters(Recorder(), p)
    for name in ("at_displacement", "at_force", "inside", "distance", "error"):
        assert getattr(model, name)("state") == (name, "state", p)
    assert (model.rows, model.form, model.meta, model.domain) == ("rows", "force", "meta", "domain")


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_copy_has_parameters_of_its_own(copied):
    model = AtParameters(Recorder(), np.array([1.0]))
    other = copied(model)
    other.p = np.array([2.0])
    assert model.at_force("state")[2] == 1.0 and other.at_force("state")[2] == 2.0
