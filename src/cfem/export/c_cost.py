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
    queries = observer + (iterations * spec.controller.halvings or iterations - 1)
    tick = queries * query + iterations * max(spec.controller.halvings, 1) * (program + softened)
    return {
        "model": query,
        "program": program,
        "program_steps": steps,
        "queries": queries,
        "tick": tick,
    }


def _searches(model: Surrogate, spec: CSpec) -> bool:
    """Whether the observer has to solve for the model's input."""
    observer, command = spec.controller.observer, spec.controller.command
    force_known = observer == "equilibrium" and command == "force"
    return observer != "previous_step" and force_known == (model.reference.form == "displacement")


def _spectral(model: Surrogate, n_a: int, n_e: int) -> int:
    n, terms = model.defines["CFEM_NZ"], model.defines["CFEM_TERMS"]
    count = n * n_a + 6 * n * (model.defines["CFEM_DEGREE"] + 1)  # polynomials and their derivatives
    count += (3 + 2 * n_e) * terms
    for _, degrees in model.groups:
        active = sum(degree > 0 for degree in degrees)
        count += active**2 + 5 * active + active * (active - 1) // 2 * (active + 1) + 2 + n_e * (2 + active)
    return count + 2 * n_a * n**2 + n_e * n_a * n


def _network(model: Surrogate) -> int:
    return int(sum(np.prod(one.weight.shape) for one in model.layers))


def _program(n: int, rows: int, m: int, steps: int) -> int:
    factor = 2 * rows * n**2 + (n + m) * n**2 + 3 * rows * n
    a_step = (n + m) * n + 4 * n**2 + n**2 + n**3  # most violated, Gram-Schmidt twice, multipliers, a rebuild
    return factor + steps * a_step + 4 * (2 * rows * n + 2 * m * n + 4 * n**2)
