"""The fit of robot and rig."""

from dataclasses import replace

import numpy as np
from cases.linear import N_Z, LinearRig, cases_of
from scipy.optimize import lsq_linear

from cfem.cases.fit import fit_cases
from cfem.cases.scatter import Scatter


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
