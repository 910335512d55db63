"""A robot with a layer: energy, W and its derivative against differences of equilibria."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar

from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.body import with_layers
from cfem.mechanics.layer import Fabric, Fibres


def test_energy_compliance_and_its_derivative_are_those_of_the_robot_with_its_layer():
    plain = bar("tet10p0", divisions=(4, 1, 1), weight=0.05)
    below = plain.body.mesh.facets[(plain.body.mesh.X[plain.body.mesh.facets][..., 2] < 1e-9).all(axis=1)]
    fabric = Fabric(0.1, 50.0, 0.2, (Fibres((1.0, 0.0, 0.0), 0.2, 200.0),))
    problem = Problem(replace(plain, body=with_layers(plain.body, [(below, fabric)])))
    lam, h = np.array([0.3, 0.8]), 1e-3

    def at(change):
        return solve(problem, force(lam + change), wanted=Wanted(third_order=True))

    middle, stiffer = at(np.zeros(2)), solve(Problem(plain), force(lam))
    assert middle.converged and middle.condensed.W_aa[1, 1] < 0.9 * stiffer.condensed.W_aa[1, 1]
    for k, unit in enumerate(np.eye(2)):
        ahead, behind = at(h * unit), at(-h * unit)
        slope = (ahead.delta_a - behind.delta_a) / (2 * h)
        np.testing.assert_allclose(middle.condensed.W_aa[:, k], slope, rtol=1e-5)
        work = (ahead.energy - behind.energy) / (2 * h)
        assert work == pytest.approx(lam @ slope, rel=1e-5)
        by_lambda = (ahead.condensed.W - behind.condensed.W) / (2 * h)
        np.testing.assert_allclose(middle.dW[k], by_lambda, atol=1e-4 * np.abs(by_lambda).max())
