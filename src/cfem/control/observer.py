"""Where the actuators stand under forces that are known, when no sensor says so.

`equilibrium` solves grad Psi(delta_a) = lambda_a, which a model of the forces answers at once and one of the
displacements in a few Newton steps, W_aa being the inverse of the Hessian of Psi. The paper's `previous_step` takes
delta_a = W_aa lambda_a + delta_free_a of the linearisation before, whose error is second order in the step."""

from typing import Literal

import numpy as np

from cfem.condensed import Condensed
from cfem.control.inverse import InverseStep
from cfem.control.loop import Model
from cfem.core.errors import NumericalError

Observer = Literal["measured", "previous_step", "equilibrium"]
EXACT, NEAR = 1e-11, 1e-5  # shares of the displacements: where Newton stops, and what rounding may leave
ITERATIONS, HALVINGS = 40, 12


def under_force(model: Model, lambda_a: np.ndarray, near: Condensed) -> Condensed:
    """The model under lambda_a (n_a,) N or MPa, searched from the state `near`. NumericalError where it has none."""
    if getattr(model, "form", "displacement") == "force":
        return model.at_force(lambda_a)
    here = near
    for _ in range(ITERATIONS):
        missing = lambda_a - here.lambda_a
        delta = here.delta_a
        step = here.W_aa @ missing
        size = float(np.abs(step).max()) / max(1.0, float(np.abs(delta).max()))
        if size <= EXACT:
            return here
        trial = None
        for share in 0.5 ** np.arange(HALVINGS):
            try:
                trial = model.at_displacement(delta + share * step)
            except NumericalError:  # beyond what the model knows: a shorter step may be within it
                trial = None
                continue
            if np.linalg.norm(lambda_a - trial.lambda_a) < np.linalg.norm(missing):
                break
        else:
            if size <= NEAR:
                return here
            trial = None
        if trial is None:
            break
        here = trial
    raise NumericalError(f"the model has no state under the forces {np.asarray(lambda_a).tolist()} N")


def by_force(model: Model, here: Condensed, step: InverseStep, share: float) -> Condensed:
    """The state after a share of an inverse step in the forces."""
    return under_force(model, here.lambda_a + share * (step.lambda_a - here.lambda_a), here)
