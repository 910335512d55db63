"""How much one tick of the C controller computes at most."""

import numpy as np

from cfem.export.c_constants import Surrogate
from cfem.export.spec import CSpec


def operations(model: Surrogate, defines: dict, spec: CSpec) -> dict[str, int]:
    """Multiplications with what is added to them, counted from the sizes: model: one query; program: one quadratic
    program when every one of its `program_steps` is taken, which is a bound, not an expectation; tick: all of it, the
    observer's queries and a softened course included."""
    n_a, n_e = defines["CFEM_NA"], defines["CFEM_NE"]
    query = _spectral(model, n_a, n_e) if model.defines["CFEM_SPECTRAL"] else _network(model)
    query += n_a**3 + (n_e + 2) * n_a**2 + n_e * n_a  # inverse, W_ea, delta_free
    steps = 10 * (2 * n_a + 1)
    program = _program(n_a, n_e + n_a, n_a, steps)
    softened = _program(2 * n_a, 3 * n_a, 0, steps) + program
    observer = 1 + (defines["CFEM_OBSERVER_ITERATIONS"] if _searches(model, spec) else 0)
    iterations = spec.controller.iterations
    tick = (observer + iterations - 1) * query + iterations * (program + softened)
    return {
        "model": query,
        "program": program,
        "program_steps": steps,
        "queries": observer + iterations - 1,
        "tick": tick,
    }


def _searches(model: Surrogate, spec: CSpec) -> bool:
    """Whether the observer has to solve for the model's input."""
    observer, command = spec.controller.observer, spec.controller.command
    force_known = observer == "equilibrium" and command == "force"
    return observer != "previous_step" and force_known == (model.reference.form == "displacement")


def _spectral(model: Surrogate, n_a: int, n_e: int) -> int:
    degrees = model.arrays["cfem_degrees"]
    active = (degrees > 0).sum(axis=1)
    count = 3 * 3 * degrees.shape[1] * model.defines["CFEM_DEGREE"]  # polynomials and their derivatives
    count += int((active + active * (active + 2) + active * (active - 1) // 2 * (active + 1)).sum())
    count += int((n_e * (1 + active[: model.defines["CFEM_EFFECTOR_TERMS"]])).sum())
    return count + 2 * n_a * degrees.shape[1] ** 2 + n_e * n_a * degrees.shape[1]


def _network(model: Surrogate) -> int:
    return int(sum(np.prod(one.weight.shape) for one in model.layers))


def _program(n: int, rows: int, m: int, steps: int) -> int:
    factor = 2 * rows * n**2 + (n + m) * n**2 + 3 * rows * n
    a_step = (n + m) * n + 4 * n**2 + n**2 + n**3  # most violated, Gram-Schmidt twice, multipliers, a rebuild
    return factor + steps * a_step + 4 * (2 * rows * n + 2 * m * n + 4 * n**2)
