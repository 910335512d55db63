"""A trained model and the user's choices as the constants of the C controller: parameters, units and standardisation
are folded in, what control does not use is left out."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed.packing import upper_indices
from cfem.core.errors import InputError, SpecError
from cfem.export.spec import ControllerSpec, CSpec
from cfem.predict.energy import layout
from cfem.predict.load import build
from cfem.predict.protocol import Predictor

ACTIVATIONS = ("relu", "tanh", "silu")
OBSERVERS = ("measured", "previous_step", "equilibrium")


@dataclass(frozen=True)
class Layer:
    """weight (inputs, outputs), float or int16 in steps (inputs,) of its rows; bias (outputs,)."""

    weight: np.ndarray
    step: np.ndarray | None
    bias: np.ndarray


@dataclass(frozen=True)
class Surrogate:
    """defines: names and values; arrays: constants by name, dtype of the scalar for coefficients, uint8 for degrees;
    layers: of a network; groups: of a series' terms, where each ends and the degrees that its terms share; reference:
    the predictor in double precision that the C code is compared with."""

    defines: dict[str, int]
    arrays: dict[str, np.ndarray]
    layers: list[Layer]
    groups: list[tuple[int, list[int]]]
    reference: Predictor

    @property
    def coefficient_bytes(self) -> int:
        """What the model's numbers take in flash."""
        arrays = [*self.arrays.values(), *(a for one in self.layers for a in (one.weight, one.step, one.bias))]
        return sum(a.nbytes for a in arrays if a is not None) + sum(2 + len(degrees) for _, degrees in self.groups)


def surrogate(meta: dict, arrays: dict[str, np.ndarray], spec: CSpec) -> tuple[Surrogate, np.ndarray]:
    """The model's constants, and the values (n_p,) of its parameters. InputError for a model that the C controller
    cannot hold."""
    if meta["kind"] not in ("spectral", "mlp"):
        raise InputError(f"kind {meta['kind']!r} has no C code", do="train kind: spectral or mlp, or export ONNX")
    if meta.get("n_c"):
        raise InputError("has inputs of contact, which the C controller does not know", do="export ONNX")
    predictor = build(meta, {name: np.asarray(a, float) if a.dtype.kind == "f" else a for name, a in arrays.items()})
    p = _parameters(predictor, spec)
    kind = _spectral if meta["kind"] == "spectral" else _mlp
    return kind(predictor, arrays, p, spec), p


def _parameters(predictor: Predictor, spec: CSpec) -> np.ndarray:
    names = [one.name for one in predictor.parameters]
    unknown = sorted(set(spec.parameters) - set(names))
    if unknown:
        raise SpecError(f"unknown {unknown}, the model has {names}", where="c.parameters")
    for one in predictor.parameters:
        if not one.low <= spec.parameters.get(one.name, one.reference) <= one.high:
            raise SpecError(f"{one.name} is outside [{one.low}, {one.high}] {one.unit}", where="c.parameters")
    return np.array([spec.parameters.get(one.name, one.reference) for one in predictor.parameters])


def _softer(predictor: Predictor, p: np.ndarray) -> float:
    return float(predictor.softer(p)) if len(p) else 1.0


def _spectral(predictor: Predictor, arrays: dict[str, np.ndarray], p: np.ndarray, spec: CSpec) -> Surrogate:
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
    value = np.vstack([potential, effector])
    kept = (value != 0).any(axis=0) | (spec.full & (compliance != 0).any(axis=0))
    order, axes, ends = _grouped(indices, np.flatnonzero(kept))
    degrees = indices[order][:, axes]
    constants = {
        "cfem_to_box": to_box[axes],
        "cfem_offset": offset[axes],
        "cfem_degrees": degrees[:, -1].astype(np.uint8),
        "cfem_series": np.ascontiguousarray(value[:, order].T).astype(scalar),
    }
    if spec.full:
        constants["cfem_compliance_series"] = np.ascontiguousarray(compliance[:, order].T).astype(scalar)
    sizes = {
        "CFEM_SPECTRAL": 1,
        "CFEM_MLP": 0,
        "CFEM_NZ": len(axes),
        "CFEM_TERMS": len(order),
        "CFEM_GROUPS": len(ends),
        "CFEM_DEGREE": max(int(degrees.max(initial=1)), 1),
    }
    groups = [(int(end), degrees[end - 1, :-1].tolist()) for end in ends]
    return Surrogate(sizes, constants, [], groups, predictor)


def _grouped(indices: np.ndarray, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Terms (M,) in an order in which those that differ in one coordinate only follow each other; the coordinates (n,),
    that one last; where each group ends. The one that makes the fewest groups is taken."""
    n = indices.shape[1]
    best = None
    for last in range(n):
        axes = np.array([*(i for i in range(n) if i != last), last])
        degrees = indices[kept][:, axes]
        order = np.lexsort(degrees.T[::-1])  # by the first coordinate, then the second, ...
        others = degrees[order][:, :-1]
        ends = np.append(np.flatnonzero((others[1:] != others[:-1]).any(axis=1)) + 1, len(order))
        if best is None or len(ends) < len(best[2]):
            best = kept[order], axes, ends
    return best


def _mlp(predictor: Predictor, arrays: dict[str, np.ndarray], p: np.ndarray, spec: CSpec) -> Surrogate:
    n_a, n_e = predictor.rows.n_a, predictor.rows.n_e
    depth = sum(name.startswith("weight_") for name in arrays)
    wide = {name: np.asarray(array, float) for name, array in arrays.items()}
    reference = predictor
    if spec.hidden_weights == "int16":
        for i in range(1, depth - 1):
            step, weight = _quantised(wide[f"weight_{i}"].T)
            wide[f"weight_{i}"] = (weight * step[:, None]).T
        reference = build(predictor.meta, wide)
    softer, q = _softer(predictor, p), predictor.q(p)
    chosen, scales = _mlp_outputs(n_a, n_e, softer, spec.full)
    layers = []
    for i in range(depth):
        weight, bias, step = wide[f"weight_{i}"], wide[f"bias_{i}"], None
        if i == 0:
            known = (np.concatenate([np.zeros(n_a), q]) - wide["in_mean"]) / wide["in_scale"]
            bias = bias + weight @ known
            weight = (weight / wide["in_scale"])[:, :n_a] * (softer if predictor.form == "force" else 1.0)
        if i == depth - 1:
            weight, bias = weight * wide["out_scale"][:, None], bias * wide["out_scale"] + wide["out_mean"]
            weight, bias = weight[chosen] * scales[:, None], bias[chosen] * scales
        weight = np.ascontiguousarray(weight.T)
        if spec.hidden_weights == "int16" and 0 < i < depth - 1:
            step, weight = _quantised(weight)
        layers.append(Layer(*(None if a is None else _as(a, spec.scalar) for a in (weight, step, bias))))
    sizes = {
        "CFEM_SPECTRAL": 0,
        "CFEM_MLP": 1,
        "CFEM_MLP_LAYERS": depth,
        "CFEM_MLP_WIDTH": max([n_a] + [len(one.bias) for one in layers[:-1]]),
        "CFEM_MLP_OUTPUTS": len(chosen),
        "CFEM_ACTIVATION": ACTIVATIONS.index(predictor.meta["activation"]),
    }
    return Surrogate(sizes, {}, layers, [], reference)


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
    rows, columns = upper_indices(n)
    place = {(i, j): k for k, (i, j) in enumerate(zip(rows.tolist(), columns.tolist(), strict=True))}
    W = [place[n_e + i, n_e + j] for i in range(n_a) for j in range(i, n_a)]
    W += [place[e, n_e + j] for e in range(n_e) for j in range(n_a)]
    free = [len(rows) + n_e + i for i in range(n_a)] + [len(rows) + e for e in range(n_e)]
    W_ee = [place[e, f] for e in range(n_e) for f in range(e, n_e)] if full else []
    scales = [softer] * len(W) + [1.0] * len(free) + [softer] * len(W_ee)
    return np.array(W + free + W_ee), np.array(scales)


def controller(predictor: Predictor, p: np.ndarray, spec: ControllerSpec, scalar: str) -> tuple[dict, dict]:
    """Defines and arrays (all double) of the controller. SpecError where a list has the wrong length."""
    n_a, n_e = predictor.rows.n_a, predictor.rows.n_e
    weights = np.ones(n_e) if spec.weights is None else np.array(spec.weights)
    start = np.zeros(n_a) if spec.start is None else np.asarray(spec.start, float)
    for name, values, size in (("weights", weights, n_e), ("start", start, n_a)):
        if len(values) != size:
            raise SpecError(f"{len(values)} numbers, the model has {size}", where=f"c.controller.{name}")
    if not weights.any():
        raise SpecError("all are 0: nothing would be controlled", where="c.controller.weights")
    home = start
    if predictor.form == "force":
        home = np.zeros(n_a) if spec.start is None else predictor.at_displacement(start, p if len(p) else None).lambda_a
    most = np.inf if spec.largest_force is None else spec.largest_force
    everywhere = np.ones(n_a)
    domain, softer = predictor.domain, _softer(predictor, p)
    arrays = {
        "cfem_rest_e": predictor.rest_e,
        "cfem_effector_weight": weights,
        "cfem_ridge": np.sqrt(spec.regularisation) * predictor.length / np.abs(predictor.reach).max(axis=1),
        "cfem_lambda_low": everywhere * (0.0 if spec.unilateral else -most),
        "cfem_lambda_high": everywhere * most,
        "cfem_delta_low": predictor.reach[:, 0],
        "cfem_delta_high": predictor.reach[:, 1],
        "cfem_step_limit": everywhere * spec.step,
        "cfem_delta_rate": everywhere * (np.inf if spec.rate is None else spec.rate),
        "cfem_lambda_rate": everywhere * (np.inf if spec.force_rate is None else spec.force_rate),
        "cfem_domain_delta_a": domain.delta_a,
        "cfem_domain_lambda_a": domain.lambda_a / softer,
        "cfem_home": home,
    }
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
        "CFEM_TOLERANCE": repr(spec.tolerance),
        "CFEM_K_P": repr(spec.K_P),
        "CFEM_K_I": repr(spec.K_I),
        "CFEM_INTEGRAL_LIMIT": repr(spec.integral_limit),
    }
    return defines, arrays
