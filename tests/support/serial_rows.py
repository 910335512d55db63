"""Modules in a row made by hand: polynomials that bend, of two or three actuators, without finite elements."""

from math import comb

import numpy as np

from cfem.condensed.packing import unpacking
from cfem.predict.load import build, skins_of
from cfem.predict.rows.serial import joined
from cfem.predict.series.derivatives import differentiated
from cfem.predict.series.energy import layout
from cfem.surrogate.series.chebyshev import index_set

AXES = ("x", "y", "z", "rx", "ry", "rz")
REST = np.array([0.0, 0.0, 40.0])
CENTRE = np.array([1.0, 0.0, 21.0])


def series(heavy, seed=0, n_a=2, curved=False):
    """Coefficients of a module that bends about x and y as its actuators go, positive definite all over."""
    indices, _ = index_set(np.ones(n_a), 1000, 3)
    rng, n_e = np.random.default_rng(seed), 9 if heavy else 6
    psi, e = 0.02 * rng.normal(size=(len(indices), 1)), 0.02 * rng.normal(size=(len(indices), n_e))
    C = 1e-3 * rng.normal(size=(len(indices), n_e * (n_e + 1) // 2))
    degree = indices.sum(axis=1)
    psi[(degree == 2) & (indices.max(axis=1) == 2)] += 3.0
    C[degree == 0] += np.diag([8.0, 8, 0.5, 0.01, 0.01, 0.005, 2, 2, 0.2][:n_e])[np.triu_indices(n_e)]
    bends = np.array([[3.0, 0, 0.1, 0, 0.2, 0, 1, 0, 0], [0, 3.0, 0.1, -0.2, 0, 0.05, 0, 1, 0]])
    e[degree == 1] += bends[np.arange(n_a) % 2, :n_e]
    to_box = np.eye(n_a) / 4
    D = 1e-4 * rng.normal(size=(n_e * (n_e + 1) * (n_e + 2) // 6, len(indices)))
    fourth, _ = index_set(np.ones(n_a), 1000, 4)  # of a basis of its own
    E = 1e-6 * np.random.default_rng(seed + 1).normal(size=(comb(n_e + 3, 4), len(fourth)))
    more = {"fourth_indices": fourth, "fourth": E} if curved else {}
    return more | {
        "indices": indices,
        "to_box": to_box,
        "offset": np.zeros(n_a),
        "series": differentiated(indices, to_box, n_a, psi, e, C),
        "third": D,
    }


def card(effectors, n_a, rest, **more):
    return {
        "kind": "spectral",
        "scene": "row",
        "form": "displacement",
        "rows": {"effectors": effectors, "actuators": tuple(f"a{i}" for i in range(n_a))},
        "row_units": [["mm", "N"]] * (len(effectors) + n_a),
        "parameters": [],
        "rest_e": list(rest),
        "reach": [[-3, 3]] * n_a,
        "length": float(rest[2]),
        "domain": {
            "delta_a": [[-4] * n_a, [4] * n_a],
            "lambda_a": [[-4] * n_a, [4] * n_a],
            "p": [[], []],
            "states": [[0] * 2 * n_a],
        },
        **more,
    }


def chain(wrench=None, softer=(1.0, 1.5, 0.8), heavy=True, mixed=True, curved=False):
    """Three modules: the middle one is another, of three actuators and another mass, where they are mixed. curved:
    they know the second derivative of their compliance."""
    axes = [f"end.{axis}" for axis in AXES] + [f"body.{axis}" for axis in "xyz"] * heavy
    rest = [*REST, 0, 0, 0, *CENTRE][: len(axes)]
    modules = [card(axes, 2, rest, masses={"body": 2e-6}), card(axes, 3, rest, masses={"body": 1e-6})][: 1 + mixed]
    k, which = len(softer), [i % 2 if mixed else 0 for i in range(len(softer))]
    shares = np.array([modules[one]["masses"]["body"] for one in which])
    centre = shares @ (CENTRE + np.arange(k)[:, None] * REST) / shares.sum()
    tip = [f"tip.{axis}" for axis in "xyz"] + [f"body.{axis}" for axis in "xyz"] * heavy
    n_a = sum(len(modules[one]["rows"]["actuators"]) for one in which)
    row = [{"model": one, "softer": soft} for one, soft in zip(which, softer, strict=True)]
    meta = card(tip, n_a, [*(k * REST), *centre][: len(tip)], modules=modules, row=row)
    meta |= {"kind": "serial"} | ({} if wrench is None else {"wrench": np.asarray(wrench)[: len(tip)].tolist()})
    return build(meta, joined([series(heavy, curved=curved), series(heavy, 7, 3, curved)][: 1 + mixed]))


CORNERS = np.array([[1.0, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]])


def end_as_skin(seed=0, n_a=2):
    """Four nodes about the end, which go with its translation."""
    arrays = series(True, seed, n_a)
    rows, packed = layout(n_a, 9), unpacking(9)
    C = arrays["series"][rows["effector_compliance"]]
    i, j = np.triu_indices(3)
    return {
        "nodes": np.arange(4),
        "rest": REST + CORNERS,
        "triangles": np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]),
        "weights": np.full(4, 0.25),
        "modes": np.repeat(np.eye(3)[:, None], 4, axis=1),
        **{name: arrays[name] for name in ("indices", "to_box", "offset")},
        "series": arrays["series"][rows["effector"]][:3],
        "compliance_indices": arrays["indices"],
        "compliance": np.vstack([C[packed[:, :3]].reshape(27, -1), C[packed[i, j]]]),
    }


def skins():
    """Arrays of module-skin.npz."""
    return joined([end_as_skin(), end_as_skin(7, 3)])


def skinned(third=False, skin=True, curved=False):
    """`chain` with skins."""
    model = chain(curved=curved)
    if not third:
        model = build(model.meta, {name: one for name, one in model.arrays.items() if not name.endswith("third")})
    if skin:
        model.skin_source = lambda: skins_of(model, skins())
    return model


WRENCH = np.array([0.05, -0.04, 0.06, 0.02, -0.03, -0.05])
DELTA = np.array([1.0, -0.5, 0.3, 1.2, -0.6, -1.0, 0.8])
