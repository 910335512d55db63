"""A trained model and the user's choices as the constants of the C controller: parameters, units and standardisation
are folded in, what control does not use is left out."""

import sys
from dataclasses import dataclass, field, replace

import numpy as np

from cfem.condensed.far import far_of
from cfem.condensed.packing import packed_indices
from cfem.condensed.parameters import vector
from cfem.condensed.strokes import STEP, TOLERANCE, ridge_of, stated_or_share
from cfem.core.actuator_units import demand_units
from cfem.core.errors import InputError, SpecError
from cfem.export.firmware import row as c_row
from cfem.export.firmware.at_rest import right_at_rest, with_rest
from cfem.export.firmware.series import Group, trees_of
from cfem.export.spec import CSpec, FirmwareControllerSpec
from cfem.plant.gains import Gains
from cfem.predict.load import build
from cfem.predict.protocol import Predictor
from cfem.predict.rows.serial import SerialPredictor, module_arrays
from cfem.predict.series.domain import Domain
from cfem.predict.series.energy import layout

ACTIVATIONS = ("relu", "tanh", "silu")
KINDS = ("spectral", "mlp", "serial")
LEAST = 1e-10  # the regularisation of the program that tells whether a goal is out of reach
OBSERVERS = ("measured", "previous_step", "equilibrium")


@dataclass(frozen=True)
class NetworkLayer:
    """weight (inputs, outputs), float or int16 in steps (inputs,) of its rows; bias (outputs,)."""

    weight: np.ndarray
    step: np.ndarray | None
    bias: np.ndarray


@dataclass(frozen=True)
class Surrogate:
    """A model as constants of C.

    defines: names and values
    arrays: constants by name, dtype of the scalar for coefficients, uint8 for degrees
    layers: of a network
    groups: of the terms of each series
    reference: predictor in double precision that the C code is compared with
    modules: models of modules in a row"""

    defines: dict[str, int]
    arrays: dict[str, np.ndarray]
    layers: list[NetworkLayer]
    groups: dict[str, list[Group]]
    reference: Predictor
    modules: list[c_row.Tables] = field(default_factory=list)

    @property
    def coefficient_bytes(self) -> int:
        """Bytes of flash that the model's numbers take."""
        arrays = [*self.arrays.values(), *(a for layer in self.layers for a in (layer.weight, layer.step, layer.bias))]
        array_bytes = sum(a.nbytes for a in arrays if a is not None) + sum(module.nbytes for module in self.modules)
        return array_bytes + sum(
            2 * ((4 + max(len(group.degrees), 1)) // 2) for groups in self.groups.values() for group in groups
        )


def surrogate(meta: dict, arrays: dict[str, np.ndarray], spec: CSpec) -> tuple[Surrogate, np.ndarray]:
    """The model's constants, and the values (n_p,) of its parameters. InputError for a model that the C controller
    cannot hold."""
    if meta["kind"] not in KINDS:
        raise InputError(f"kind {meta['kind']!r} has no C code", do=f"train kind: {', '.join(KINDS)}, or export ONNX")
    unsupported = [module["kind"] for module in meta.get("modules") or [] if module["kind"] != "spectral"]
    if unsupported:
        raise InputError(
            f"modules of kind {unsupported[0]!r} have no C code", do="train the module with kind: spectral"
        )
    if meta.get("n_c"):
        raise InputError("has contact inputs, which the C controller does not support", do="export ONNX")
    predictor = build(meta, {name: np.asarray(a, float) if a.dtype.kind == "f" else a for name, a in arrays.items()})
    p = vector(predictor.parameters, spec.parameters, "c.parameters")
    kinds = {"spectral": _spectral, "mlp": _mlp, "serial": _serial}
    model = kinds[meta["kind"]](predictor, arrays, p, spec)
    if not spec.full:
        return model, p
    # W_ee alone is concerned, which control does not use
    sizes = np.zeros(0) if predictor.sizes is None else predictor.sizes
    defines = {**model.defines, "CFEM_SEMIDEFINITE": int(len(sizes) > 0)}
    units = {"cfem_sizes": sizes * np.sqrt(_softer(predictor, p))} if len(sizes) else {}
    return replace(model, defines=defines, arrays={**model.arrays, **units}), p


def _softer(predictor: Predictor, p: np.ndarray) -> float:
    return float(predictor.softer(p)) if len(p) else 1.0


def _spectral(predictor: Predictor, arrays: dict[str, np.ndarray], p: np.ndarray, spec: CSpec) -> Surrogate:
    """Constants of an energy model: its series by term, their degrees and groups, in coordinates of the learned box."""
    n_a, n_e = predictor.rows.n_a, predictor.rows.n_e
    softer, scalar = _softer(predictor, p), np.dtype(spec.scalar if spec.scalar == "double" else "float32")
    parts = layout(n_a, n_e)
    series, indices = arrays["series"], arrays["indices"]
    potential, effector = series[parts["energy"]], series[parts["effector"]]
    compliance = series[parts["effector_compliance"]] * softer
    to_box, offset = arrays["to_box"][:, :n_a], arrays["offset"] + arrays["to_box"][:, n_a:] @ predictor.q(p)
    # W ~ softer, lambda ~ 1 / softer: the energy Psi(delta) and its dual Psi*(lambda) both scale with 1 / softer.
    potential = potential / softer
    if predictor.form == "force":
        to_box = to_box * softer
    outputs = np.vstack([effector, compliance]) if spec.full else effector
    series = {"potential": potential, "effector": outputs}
    kept = {name: np.flatnonzero((value != 0).any(axis=0)) for name, value in series.items()}
    axes, trees = trees_of(indices, kept)
    constants = {"cfem_to_box": to_box[axes], "cfem_offset": offset[axes]}
    for name, tree in trees.items():
        constants[f"cfem_{name}"] = series[name][:, tree.order].T.ravel().astype(scalar)  # term by term
        constants[f"cfem_{name}_degrees"] = indices[tree.order, axes[-1]].astype(np.uint8)
    sizes = {
        "CFEM_SPECTRAL": 1,
        "CFEM_MLP": 0,
        "CFEM_SERIAL": 0,
        "CFEM_ROW": 0,
        "CFEM_SERIES_NA": n_a,
        "CFEM_SERIES_NE": n_e,
        "CFEM_SERIES_OUTPUTS": len(outputs),
        "CFEM_NZ": len(axes),
        "CFEM_DEGREE": max(int(indices[np.union1d(*kept.values())].max(initial=1)), 1),
        **{f"CFEM_{name.upper()}_GROUPS": len(tree.groups) for name, tree in trees.items()},
    }
    return Surrogate(sizes, constants, [], {name: tree.groups for name, tree in trees.items()}, predictor)


def _serial(predictor: SerialPredictor, arrays: dict[str, np.ndarray], p: np.ndarray, spec: CSpec) -> Surrogate:
    """Unloaded modules of one model are its series, and what the modules are beside it."""
    if spec.full:
        raise SpecError(
            "a model of modules in a row has W_aa, W_ea and delta_free only", where="c.full", do="set full: false"
        )
    if c_row.more_than_series(predictor):
        models, which = c_row.tables_of(predictor, spec.scalar)
        defines, constants = c_row.constants(predictor, models, which)
        return Surrogate(defines, constants, [], {}, predictor, models)
    module = _spectral(predictor.models[0], module_arrays(arrays, 0), p, spec)
    softer = predictor.softer
    return replace(
        module,
        defines={**module.defines, "CFEM_SERIAL": 1, "CFEM_MODULES": len(softer)},
        arrays={**module.arrays, "cfem_softer": softer, "cfem_module_rest": predictor.rests[0, :3]},
        reference=predictor,
    )


def _mlp(predictor: Predictor, arrays: dict[str, np.ndarray], p: np.ndarray, spec: CSpec) -> Surrogate:
    """Layers of a network of the entries; scales, parameters and units are folded into the first and the last."""
    n_a, n_e = predictor.rows.n_a, predictor.rows.n_e
    depth = sum(name.startswith("weight_") for name in arrays)
    wide = {name: np.asarray(a, float) if a.dtype.kind == "f" else a for name, a in arrays.items()}
    reference = predictor
    if spec.hidden_weights == "int16":
        for i in range(1, depth - 1):
            step, weight = _quantised(wide[f"weight_{i}"].T)
            wide[f"weight_{i}"] = (weight * step[:, None]).T
        reference = build(predictor.meta, wide)
    softer, beside = _softer(predictor, p), predictor.beside(predictor.q(p))
    chosen, scales = _mlp_outputs(n_a, n_e, softer, spec.full)
    layers = []
    for i in range(depth):
        weight, bias, step = wide[f"weight_{i}"], wide[f"bias_{i}"], None
        if i == 0:
            known = (np.concatenate([np.zeros(n_a), beside]) - wide["in_mean"]) / wide["in_scale"]
            bias = bias + weight @ known
            weight = (weight / wide["in_scale"])[:, :n_a] * (softer if predictor.form == "force" else 1.0)
        if i == depth - 1:
            weight, bias = weight * wide["out_scale"][:, None], bias * wide["out_scale"] + wide["out_mean"]
            weight, bias = weight[chosen] * scales[:, None], bias[chosen] * scales
        weight = np.ascontiguousarray(weight.T)
        if spec.hidden_weights == "int16" and 0 < i < depth - 1:
            step, weight = _quantised(weight)
        layers.append(NetworkLayer(*(None if a is None else _as(a, spec.scalar) for a in (weight, step, bias))))
    sizes = {
        "CFEM_SPECTRAL": 0,
        "CFEM_MLP": 1,
        "CFEM_SERIAL": 0,
        "CFEM_ROW": 0,
        "CFEM_MLP_LAYERS": depth,
        "CFEM_MLP_WIDTH": max([n_a] + [len(layer.bias) for layer in layers[:-1]]),
        "CFEM_MLP_OUTPUTS": len(chosen),
        "CFEM_ACTIVATION": ACTIVATIONS.index(predictor.meta["activation"]),
    }
    return Surrogate(sizes, {}, layers, {}, reference)


def _as(values: np.ndarray, scalar: str) -> np.ndarray:
    return values if values.dtype == np.int16 else values.astype(np.float32 if scalar == "float" else np.float64)


def _quantised(weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Steps (inputs,) and int16 weights (inputs, outputs)."""
    step = np.abs(weight).max(axis=1) / 32767
    step[step == 0] = 1.0
    step = step.astype(np.float32).astype(float)  # what float holds, so that both scalars mean the same network
    return step, np.clip(np.rint(weight / step[:, None]), -32767, 32767).astype(np.int16)


def _mlp_outputs(n_a: int, n_e: int, softer: float, full: bool) -> tuple[np.ndarray, np.ndarray]:
    """Which outputs of the network, and what to scale them by, in the order of cfem_parts.h; rows of W are e, a."""
    n = n_a + n_e
    rows, columns = packed_indices(n)
    place = {(i, j): k for k, (i, j) in enumerate(zip(rows.tolist(), columns.tolist(), strict=True))}
    W = [place[n_e + i, n_e + j] for i in range(n_a) for j in range(i, n_a)]
    W += [place[e, n_e + j] for e in range(n_e) for j in range(n_a)]
    free = [len(rows) + n_e + i for i in range(n_a)] + [len(rows) + e for e in range(n_e)]
    W_ee = [place[e, f] for e in range(n_e) for f in range(e, n_e)] if full else []
    scales = [softer] * len(W) + [1.0] * len(free) + [softer] * len(W_ee)
    return np.array(W + free + W_ee), np.array(scales)


def multipliers(spec: FirmwareControllerSpec, n_a: int, pressures: np.ndarray | None) -> np.ndarray:
    """Smallest and largest forces (n_a, 2), N or MPa; pressures: (n_a, 2) that the scene states, if any."""
    box = np.tile([0.0 if spec.unilateral else -np.inf, np.inf], (n_a, 1)) if pressures is None else pressures
    return box if spec.largest_force is None else np.clip(box, -spec.largest_force, spec.largest_force)


def _courses(predictor: Predictor, spec: FirmwareControllerSpec, pressures: np.ndarray | None) -> np.ndarray:
    """Courses (n_a, 2) mm or mm^3. Where pressures are commanded within stated bounds, these protect the robot, and the
    course only has to be one that the model knows, as in `cfem control`."""
    if spec.command == "displacement" or pressures is None:
        return predictor.reach
    known = np.stack([predictor.reach, predictor.domain.delta_a.T])
    return np.column_stack([known[..., 0].min(axis=0), known[..., 1].max(axis=0)])


def _weights_and_start(spec: FirmwareControllerSpec, n_a: int, n_e: int) -> tuple[np.ndarray, np.ndarray]:
    """Weights (n_e,) of the effector rows and displacements (n_a,) at the start. SpecError where a list has the wrong
    length, or nothing would be controlled."""
    weights = np.ones(n_e) if spec.weights is None else np.array(spec.weights)
    start = np.zeros(n_a) if spec.start is None else np.asarray(spec.start, float)
    for name, values, size in (("weights", weights, n_e), ("start", start, n_a)):
        if len(values) != size:
            raise SpecError(f"has {len(values)} numbers, and the model needs {size}", where=f"c.controller.{name}")
    if not weights.any():
        raise SpecError(
            "all weights are 0, so nothing would be controlled",
            where="c.controller.weights",
            do="give one of them a positive number",
        )
    return weights, start


def _sheet(domain: Domain) -> dict[str, np.ndarray]:
    """Axes (n_a, n_a) of the sheet that the training states fill, and its bounds (2, n_a); axes that it lacks are 0."""
    axes, bounds = domain.sheet
    lacking = domain.delta_a.shape[1] - len(axes)
    return {
        "cfem_domain_axes": np.pad(axes, ((0, lacking), (0, 0))),
        "cfem_domain_along": np.pad(bounds, ((0, 0), (0, lacking))),
    }


def controller(
    predictor: Predictor, p: np.ndarray, spec: FirmwareControllerSpec, scalar: str, pressures: np.ndarray | None = None
) -> tuple[dict, dict]:
    """Defines and arrays (all double) of the controller; pressures: (n_a, 2) MPa that the scene states, if any.
    SpecError where a list has the wrong length, or a quantity is of other actuators."""
    demand_units(spec, predictor.actuator_units, "c.controller")
    n_a, n_e = predictor.rows.n_a, predictor.rows.n_e
    weights, start = _weights_and_start(spec, n_a, n_e)
    home = start
    if predictor.form == "force":
        home = np.zeros(n_a) if spec.start is None else predictor.at_displacement(start, p if len(p) else None).lambda_a
    gains = Gains(spec.K_P, spec.K_I, phase_margin=spec.phase_margin)
    everywhere, box, courses = np.ones(n_a), multipliers(spec, n_a, pressures), _courses(predictor, spec, pressures)
    domain, softer = predictor.domain, _softer(predictor, p)
    arrays = {
        "cfem_rest_e": predictor.rest_e,
        "cfem_far": far_of(predictor.rows, predictor.length),
        "cfem_effector_weight": weights,
        "cfem_ridge": ridge_of(spec.regularisation, predictor.reach, predictor.length),
        "cfem_least_ridge": ridge_of(LEAST, predictor.reach, predictor.length),
        "cfem_damping": ridge_of(spec.damping, predictor.reach, predictor.length),
        "cfem_lambda_low": box[:, 0],
        "cfem_lambda_high": box[:, 1],
        "cfem_delta_low": courses[:, 0],
        "cfem_delta_high": courses[:, 1],
        "cfem_tolerance": stated_or_share(spec.tolerance, TOLERANCE, predictor.reach),
        "cfem_step_limit": stated_or_share(spec.step, STEP, predictor.reach),
        "cfem_delta_rate": everywhere * (np.inf if spec.rate is None else spec.rate),
        "cfem_lambda_rate": everywhere * (np.inf if spec.force_rate is None else spec.force_rate),
        "cfem_domain_delta_a": domain.delta_a,
        "cfem_domain_lambda_a": domain.lambda_a / softer,
        **_sheet(domain),
        "cfem_home": home,
        "cfem_integral_gain": np.array([gains.integral_at(late) for late in range(spec.late)]),
    }
    if right_at_rest(predictor, arrays, p):
        arrays |= with_rest(predictor, arrays, p)
    defines = {
        "CFEM_NA": n_a,
        "CFEM_NE": n_e,
        "CFEM_FORM_DISPLACEMENT": int(predictor.form == "displacement"),
        "CFEM_OBSERVER": f"CFEM_OBSERVER_{spec.observer.upper()}",
        "CFEM_OBSERVER_ITERATIONS": 20,
        "CFEM_OBSERVER_TOLERANCE": 1e-5 if scalar == "float" else 1e-11,
        "CFEM_COMMAND_FORCE": int(spec.command == "force"),
        "CFEM_ITERATIONS": spec.iterations,
        "CFEM_HALVINGS": spec.halvings,
        "CFEM_K_P": repr(spec.K_P),
        "CFEM_INTEGRAL_LIMIT": repr(sys.float_info.max if spec.integral_limit is None else spec.integral_limit),
        "CFEM_LATE": spec.late,
    }
    return defines, arrays
