"""Cost of one tick of the C controller, at most."""

import numpy as np

from cfem.export.firmware.constants import Surrogate
from cfem.export.spec import CSpec

ROW_STEPS = 6  # Newton steps of modules in a row under loads that are counted; most take 4 to 6


def operations(model: Surrogate, defines: dict, spec: CSpec) -> dict[str, int]:
    """Multiplications with what is added to them, counted from the sizes: model: one query; program: one quadratic
    program when every one of its `program_steps` is taken, which is a bound, not an expectation; tick: all of it, the
    observer's queries and a softened course included."""
    n_a, n_e = defines["CFEM_NA"], defines["CFEM_NE"]
    query = _query(model, n_a, n_e)
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


def _query(model: Surrogate, n_a: int, n_e: int) -> int:
    """Operations of one query of the model, by its kind."""
    sizes = model.defines
    if sizes["CFEM_ROW"]:
        return _row(model, n_a, n_e)
    if sizes["CFEM_SERIAL"]:
        n = sizes["CFEM_SERIES_NA"]
        module = _spectral(model, n, sizes["CFEM_SERIES_NE"]) + n**3 + (n_e + 2) * n**2 + n_e * n
        # products of three by three, exp and Jacobian, the arm; twists and tip
        rotations = 3 * 27 + 2 * 15 + 9 + 24 * n
        return sizes["CFEM_MODULES"] * (module + rotations) + n_e * n_a
    query = _spectral(model, n_a, n_e) if sizes["CFEM_SPECTRAL"] else _network(model)
    return query + n_a**3 + (n_e + 2) * n_a**2 + n_e * n_a  # inverse, W_ea, delta_free


def _row(model: Surrogate, n_a: int, n_e: int) -> int:
    """Operations of one query of modules under loads, with ROW_STEPS Newton steps."""
    pose = model.defines["CFEM_POSE"] + 3 * model.defines["CFEM_ROW_PATCHES"]
    count = model.defines["CFEM_MODULES"]
    N, total = pose * count, 0
    for which in model.arrays["cfem_module_model"]:
        module, n = model.modules[which], len(model.modules[which].offset)
        all_ = 1 + n + n * (n + 1) // 2
        outputs = sum(coefficients.size for _, coefficients in module.series.values())
        terms = sum(len(numbers) for numbers, _ in module.series.values())
        total += len(module.degrees) * (all_ + 1) * n + 5 * outputs + terms * (all_ + pose * (2 + n))
        total += ROW_STEPS * 4 * pose**3
    newton = ROW_STEPS * (pose * N * N + N**3 // 3)
    return total + newton + N**3 // 3 + n_a * N * (2 * N + n_e) + n_a**3 + (n_e + 2) * n_a**2


def _searches(model: Surrogate, spec: CSpec) -> bool:
    """Tells whether the observer has to solve for the model's input."""
    observer, command = spec.controller.observer, spec.controller.command
    force_known = observer == "equilibrium" and command == "force"
    return observer != "previous_step" and force_known == (model.reference.form == "displacement")


def _spectral(model: Surrogate, n_a: int, n_e: int) -> int:
    n, outputs = model.defines["CFEM_NZ"], model.defines["CFEM_SERIES_OUTPUTS"]
    count = n * n_a + 6 * n * (model.defines["CFEM_DEGREE"] + 1)  # polynomials and their derivatives
    count += 3 * len(model.arrays["cfem_potential"]) + 2 * model.arrays["cfem_effector"].size
    for name, groups in model.groups.items():
        for left in (n - d for group in groups for d in range(group.depth, n - 1)):  # coordinates from d on
            count += (left + 1) * (left + 2) // 2 if name == "potential" else (left + 1) * outputs
    return count + 2 * n_a * n**2 + n_e * n_a * n


def _network(model: Surrogate) -> int:
    return int(sum(np.prod(layer.weight.shape) for layer in model.layers))


def _program(n: int, rows: int, m: int, steps: int) -> int:
    factor = 2 * rows * n**2 + (n + m) * n**2 + 3 * rows * n
    a_step = (n + m) * n + 4 * n**2 + n**2 + n**3  # most violated, Gram-Schmidt twice, multipliers, a rebuild
    return factor + steps * a_step + 4 * (2 * rows * n + 2 * m * n + 4 * n**2)
