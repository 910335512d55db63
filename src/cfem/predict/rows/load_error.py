"""Estimated error of a module in a row under loads, at one state: what follows its last order in the wrench, and what
its model is off, both carried to the tip.

A module knows the motion under a wrench w to some order: y_1 = C w, y_2 = D[w, w] / 2, and y_3 = E[w, w, w] / 6 where
it has E. What its approximant guesses beyond (`cfem.predict.loads.wrench_series`) measures what follows E. Along w
alone it does not see what follows D. Where loads change the stiffness in proportion, as of a column or of a strip that
moments twist, the next part of the potential is y_2 . C+ y_2 / 2, and its derivative by w

    y_3 = D[w] C+ y_2

C+ is the inverse of C of the end, along the directions that are soft: others are held by the actuators. So a moment
that hardly moves the end still counts: D knows how it softens the module in other directions.

Rotations bend what they carry without any change of stiffness, to the third order by a share of y_1 times their square.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cfem.condensed.model_error import ErrorBound
from cfem.core.errors import InputError
from cfem.predict.loads.wrench_series import Held
from cfem.predict.rows.serial import END

SOFT = 0.02  # of the largest compliance, in the module's length and radians: a direction that is less soft is held
GUESSED = 0.5  # of what the approximant guesses beyond D, beside its difference to y_3
BEYOND = 1.5  # times what it guesses beyond E
TURNED = 0.3  # of y_1 times the square of its rotation: sin and cos leave a sixth of one rotation
FITTED = 0.3  # of the bounds of D and E, of the sum over a module's rows: errors of rows take off from each other


def module_error(
    module: Held,
    w: np.ndarray,
    moved: np.ndarray,
    carried: np.ndarray,
    units: np.ndarray,
    errors: Mapping[str, Any],
    extrapolation: float,
) -> float:
    """Estimated error of the tip, mm, that one module makes under w (n,) N and N mm on its rows.

    moved: (n,) displacements of the rows by w
    carried: (3, n) motion of the tip by the module's rows
    units: (n,) of the rows, the module's length and radians
    errors: of its model, as `cfem train` has measured them
    extrapolation: of its model at its state

    InputError where the model was trained before it stated bounds."""
    orders = [module.C[0] @ w, module.D[0] @ w @ w / 2]
    if module.E is None:
        guessed, turned = moved - sum(orders), TURNED * (orders[0][3:END] @ orders[0][3:END])
        off = [third_order(module, w, orders[1], units) - guessed, GUESSED * guessed, turned * orders[0]]
    else:
        known = module.E.watched
        orders.append(np.pad(module.E.cubic(w[:known])[0], (0, len(w) - known)))
        off = [BEYOND * (moved - sum(orders))]
    off.append(2.0 * np.sqrt(errors.get("frame_loss", 0.0)) * orders[0])
    for name, order in zip(("dC", "d2C"), orders[1:], strict=False):
        if name in errors.get("of_loads", {}):
            off.append(FITTED * _bound(errors["of_loads"][name]).at(np.array(extrapolation)) * order)
    return float(sum(np.linalg.norm(carried * each, axis=0).sum() for each in off))


def _bound(stated: Any) -> ErrorBound:
    """Bound as `cfem train` has written it."""
    if not isinstance(stated, Mapping):
        raise InputError("the model of a module does not bound its error under loads", do="train it again, and the row")
    return ErrorBound(**stated)


def third_order(module: Held, w: np.ndarray, second: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Displacements (n,) of the third order in w (n,), of the second (n,), where loads change stiffness in
    proportion."""
    return (module.D[0] @ w)[:, :END] @ _soft_stiffness(module.C[0][:END, :END], units[:END]) @ second[:END]


def _soft_stiffness(C: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Inverse (k, k) of C (k, k) along its soft directions."""
    compliance, directions = np.linalg.eigh(C / units / units[:, None])
    soft = compliance > SOFT * compliance[-1]
    kept = directions[:, soft] / units[:, None]
    return kept / compliance[soft] @ kept.T
