"""The folder that a control engineer drops into firmware: constant C sources, the robot's constants, a self-test."""

from pathlib import Path

import numpy as np

from cfem.condensed.parameters import vector
from cfem.core.artefact.files import write_whole
from cfem.core.errors import NumericalError
from cfem.export.firmware import c_text
from cfem.export.firmware import row as c_row
from cfem.export.firmware.constants import OBSERVERS, NetworkLayer, Surrogate, controller, multipliers, surrogate
from cfem.export.firmware.copying import copy_sources
from cfem.export.firmware.cost import operations
from cfem.export.firmware.single import write_single
from cfem.export.spec import CSpec
from cfem.predict.protocol import Predictor

TOLERANCE = {"double": 1e-12, "float": 1e-5}
GOAL_TOLERANCE = {"double": 1e-6, "float": 1e-4}  # of the robot's length
COEFFICIENTS = ("cfem_potential", "cfem_effector")  # in the scalar type: all else acts on double inputs
MARGIN = 0.02  # of course and force: goals nearer than this to a bound are not asked of the self-test


def write_c(
    folder: Path,
    meta: dict,
    arrays: dict[str, np.ndarray],
    spec: CSpec,
    states: np.ndarray,
    pressures: np.ndarray | None = None,
) -> dict:
    """Fills `folder`; states (m, n_a): inputs of the model for the self-test; pressures: (n_a, 2) MPa that the scene
    states, if any. Returns what it costs, without compiling it."""
    if spec.arithmetic == "float":
        spec = spec.model_copy(update={"scalar": "float"})
    copy_sources(folder, "controller", *(["wire"] if spec.wire else []))
    model, p = surrogate(meta, arrays, spec)
    predictor = model.reference
    defines, constants = controller(predictor, p, spec.controller, spec.scalar, pressures)
    _, states = at_robot(predictor, spec, states)
    box = multipliers(spec.controller, predictor.rows.n_a, pressures)
    vectors = [_vector(predictor, p, s, spec, box) for s in states[: spec.vectors]]
    reachable = [case["x_e"] for case in vectors if case["reachable"]]
    constants["cfem_example_goal"] = reachable[0] if reachable else predictor.rest_e
    contact = 0  # 1: the tick plans among rigid obstacles, 2: among soft ones too
    if spec.obstacles and predictor.form == spec.controller.command == "displacement":
        contact = 1 + any(obstacle.kind in ("robot", "itself") for obstacle in spec.obstacles.values())
    defines_here = {**defines, "CFEM_FULL": int(spec.full), "CFEM_CONTACT": contact}
    header, data = _data(meta, model, defines_here, constants, spec.scalar)
    write_whole(folder / "cfem_data.h", header.encode())
    write_whole(folder / "cfem_data.c", data.encode())
    write_whole(folder / "cfem_vectors.h", _vectors(vectors, predictor.length, spec).encode())
    if spec.arithmetic == "float":
        write_single(folder)
    return {
        "kind": meta["kind"],
        "form": meta["form"],
        "scalar": spec.scalar,
        "coefficient_bytes": model.coefficient_bytes,
        "operations": operations(model, defines, spec),
    }


def at_robot(predictor: Predictor, spec: CSpec, states: np.ndarray) -> tuple[np.ndarray | None, np.ndarray]:
    """p (n_p,) of the robot, None where the model has none, and inputs (m, n_a) of its model for those of the
    reference: lambda ~ E."""
    p = vector(predictor.parameters, spec.parameters, "c.parameters")
    if not len(p):
        return None, states
    return p, states / predictor.softer(p) if predictor.form == "force" else states


def _data(
    meta: dict, model: Surrogate, defines: dict, constants: dict[str, np.ndarray], scalar: str
) -> tuple[str, str]:
    """cfem_data.h, cfem_data.c."""
    header = [
        c_text.comment(
            f"{meta['scene']}, kind {meta['kind']}, form {meta['form']}: by cfem export. Units: mm, N, MPa."
        ),
        "\n",
        "#ifndef CFEM_DATA_H\n#define CFEM_DATA_H\n\n#include <stdint.h>\n\n",
        f"typedef {scalar} cfem_real;\n\n",
        c_text.defines({f"CFEM_OBSERVER_{name.upper()}": i for i, name in enumerate(OBSERVERS)}),
        c_text.defines({**defines, **model.defines}),
        c_text.defines(
            {f"CFEM_{name.upper()}": c_text.string(" ".join(meta["rows"][name])) for name in ("effectors", "actuators")}
        ),
        "\n",
    ]
    body = ['#include "cfem_data.h"\n\n#include <math.h>\n\n']

    def add(name: str, values: np.ndarray, kind: str) -> None:
        declaration, definition = c_text.array(name, values, kind)
        header.append(declaration + "\n")
        body.append(definition + "\n\n")

    for name, values in constants.items():
        add(name, np.asarray(values, float), "double")
    for name, values in model.arrays.items():
        if values.dtype == np.uint8:
            add(name, values, "uint8_t")
        else:
            add(name, values, "cfem_real" if name in COEFFICIENTS else "double")
    if model.groups:
        n = max(model.defines["CFEM_NZ"] - 1, 1)
        header.append(
            "\n/* Terms up to `end` that share the degrees of all coordinates but the last; from the coordinate\n"
            "   `depth` on their sums are complete. */\n"
            f"typedef struct {{\n    uint16_t end;\n    uint8_t depth, degrees[{n}];\n}} cfem_group;\n\n"
        )
        for name, groups in model.groups.items():
            header.append(f"extern const cfem_group cfem_{name}_groups[CFEM_{name.upper()}_GROUPS];\n")
            rows = [
                f"{{{group.end}, {group.depth}, {{{', '.join(map(str, group.degrees or [0]))}}}}}" for group in groups
            ]
            body.append(f"const cfem_group cfem_{name}_groups[] = {{" + ",\n".join(rows) + "};\n\n")
    if model.modules:
        more = c_row.text(model.modules)
        header.append(more[0])
        body.append(more[1])
    if model.layers:
        more = _layers(model.layers)
        header.append(more[0])
        body.append(more[1])
    return "".join([*header, "\n#endif\n"]), "".join(body)


LAYER = """
typedef struct {
    int inputs, outputs;
    const cfem_real *weight; /* (inputs, outputs), or: */
    const int16_t *narrow;   /* the same in steps of */
    const cfem_real *step;   /* (inputs,) */
    const cfem_real *bias;   /* (outputs,) */
} cfem_layer;

extern const cfem_layer cfem_layers[];
"""


def _layers(layers: list[NetworkLayer]) -> tuple[str, str]:
    """Text of a network's layers, for cfem_data.h and for cfem_data.c."""
    body, rows = [], []
    for i, layer in enumerate(layers):
        narrow = layer.step is not None
        parts = (
            ("weight", layer.weight.ravel(), "int16_t" if narrow else "cfem_real"),
            ("step", layer.step, "cfem_real"),
        )
        for part, values, kind in (*parts, ("bias", layer.bias, "cfem_real")):
            if values is not None:
                body.append("static " + c_text.array(f"{part}_{i}", values, kind)[1] + "\n\n")
        weights = f"0, weight_{i}, step_{i}" if narrow else f"weight_{i}, 0, 0"
        rows.append(f"{{{layer.weight.shape[0]}, {layer.weight.shape[1]}, {weights}, bias_{i}}}")
    body.append("const cfem_layer cfem_layers[] = {" + ",\n".join(rows) + "};\n")
    return LAYER, "".join(body)


def _vector(predictor: Predictor, p: np.ndarray, s: np.ndarray, spec: CSpec, box: np.ndarray) -> dict:
    """Numbers of the Python model at s (n_a,), and whether the controller, multipliers within box (n_a, 2), can go
    there."""
    rows = predictor.rows
    condensed = predictor.at(s, p if len(p) else None)
    W, free = condensed.W, condensed.delta_free
    delta, lam = condensed.delta, condensed.lam
    width = predictor.reach[:, 1] - predictor.reach[:, 0]
    inside = (delta[rows.a] > predictor.reach[:, 0] + MARGIN * width) & (
        delta[rows.a] < predictor.reach[:, 1] - MARGIN * width
    )
    scale = float(np.abs(predictor.domain.lambda_a).max())
    strong = (lam > box[:, 0] + MARGIN * scale) & (lam < box[:, 1] - MARGIN * scale)
    numbers = {
        "s": s,
        "delta_a": delta[rows.a],
        "lambda_a": lam,
        "W_aa": W[rows.a, rows.a].ravel(),
        "W_ea": W[rows.e, rows.a].ravel(),
        "free_a": free[rows.a],
        "free_e": free[rows.e],
        "x_e": predictor.rest_e + delta[rows.e],
        "reachable": bool(inside.all() and strong.all()),
    }
    if spec.full:
        numbers["W_ee"] = W[rows.e, rows.e].ravel()
    if not all(np.isfinite(value).all() for value in numbers.values()):
        raise NumericalError("the model gives numbers that are not finite at a test state", do="train it again")
    return numbers


def _vectors(vectors: list[dict], length: float, spec: CSpec) -> str:
    """cfem_vectors.h."""
    names = [name for name in vectors[0] if name != "reachable"]
    fields = "".join(f" double {'goal' if name == 'x_e' else name}[{len(vectors[0][name])}];" for name in names)
    rows = []
    for case in vectors:
        numbers = ", ".join("{" + ", ".join(c_text.number(x, "double") for x in case[name]) + "}" for name in names)
        rows.append("{" + numbers + f", {int(case['reachable'])}}}")
    sizes = c_text.defines(
        {
            "CFEM_VECTORS": len(vectors),
            "CFEM_VECTOR_TOLERANCE": TOLERANCE[spec.scalar],
            "CFEM_GOAL_TOLERANCE": f"{GOAL_TOLERANCE[spec.scalar] * length!r} /* mm */",
        }
    )
    return (
        "/* The Python model at states of its test set, and goals there that are within reach: by cfem export. */\n"
        f"{sizes}\ntypedef struct {{{fields} int reachable; }} cfem_vector;\n\n"
        f"static const cfem_vector cfem_vectors[CFEM_VECTORS] = {{\n" + ",\n".join(rows) + "};\n"
    )
