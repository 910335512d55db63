"""The fit of robot and rig."""

from dataclasses import replace

import numpy as np
import pytest
from identify.cases.linear import N_Z, LinearRig, cases_of
from scipy.optimize import lsq_linear

from cfem.identify.cases.fit import fit_cases
from cfem.identify.cases.scatter import Scatter


def test_a_number_at_the_end_of_its_range_holds_no_other_back():
    """Against linear least squares with bounds."""
    rig = LinearRig(np.random.default_rng(3), 0.0)
    rig.unknowns = (replace(rig.unknowns[0], bounds=(0.0, 50.0)), *rig.unknowns[1:])
    blank = cases_of(np.linspace(0.3, 1, 5), np.zeros((5, 4, 3)))
    places = rig.see(blank, np.array([-2.0, 1.0, -1.0, 0.5, 2.0]), np.zeros(0)).y
    seen = rig.see(blank, np.zeros(N_Z), np.zeros(0))
    prior = np.diag([float(one.known) for one in rig.unknowns])
    A, b = np.vstack([seen.by_z.reshape(-1, N_Z), prior]), np.concatenate([places.ravel(), np.zeros(N_Z)])
    wanted = lsq_linear(A, b, np.transpose([one.bounds for one in rig.unknowns]), tol=1e-14).x
    found = fit_cases(rig, replace(blank, places=places), Scatter(1.0), fixed_scatter=True)
    assert wanted[0] < 1e-6
    np.testing.assert_allclose(found.z, wanted, atol=2e-3)


def test_an_unknown_that_nothing_measures_keeps_what_was_known_of_it_before():
    """z is of size one: a standard deviation, or a quarter of its range."""
    rig = LinearRig(np.random.default_rng(3), 0.0)
    rig._first[..., -1] = rig._second[..., -1] = 0.0
    blank = cases_of(np.linspace(0.3, 1, 5), np.zeros((5, 4, 3)))
    places = rig.see(blank, np.ones(N_Z), np.zeros(0)).y + np.random.default_rng(1).standard_normal((5, 4, 3))
    deviations = np.sqrt(np.diag(fit_cases(rig, replace(blank, places=places), Scatter(1.0)).covariance))
    assert deviations[-1] == pytest.approx(1.0) and (deviations[:-1] < 0.5).all()
