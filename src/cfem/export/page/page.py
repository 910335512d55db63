"""The robot in a file: one page that runs anywhere, with the C controller as WebAssembly and this robot as data."""

from collections.abc import Sequence
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np

from cfem import viewer
from cfem.core.console.shown import length
from cfem.core.errors import InputError
from cfem.export.firmware.at_rest import right_at_rest, with_rest
from cfem.export.firmware.constants import controller, surrogate
from cfem.export.firmware.embedding import Embedding
from cfem.export.page.block import block, skin_series
from cfem.export.page.body import DrawnBody, body, lines
from cfem.export.page.chambers import ChamberWall
from cfem.export.page.data import Fixed, pack
from cfem.export.page.layout import motion_layout
from cfem.export.page.load import weight
from cfem.export.page.motion import moves
from cfem.export.spec import CSpec, FirmwareControllerSpec
from cfem.predict.protocol import Predictor

ASSETS = files("cfem.export.page") / "web"
SCRIPTS = ("data.js", "robot.js", "words.js", "reach.js", "strain.js", "chambers.js", "hands.js", "motion.js", "app.js")
KINDS = ("spectral", "serial")
LEAST = 1e-3  # mm: a smaller error is of no interest to those who look
EXACT = 1e-7  # mm: the finest step of what is stored of places
POINT = ("x", "y", "z")


def page(
    meta: dict,
    arrays: dict[str, np.ndarray],
    skin: dict[str, np.ndarray],
    spec: CSpec,
    robot: Embedding,
    concerns: Sequence[str] = (),
    moving: dict[str, np.ndarray] | None = None,
    walls: Sequence[ChamberWall] = (),
) -> str:
    """The whole file. skin: arrays of `cfem.predict.series.skin`; concerns: what is poor about the model, said first;
    moving: arrays of its motion.npz, where it has learned to move; walls: of its chambers. InputError where the page
    has no room for the robot."""
    if meta["kind"] not in KINDS:
        raise InputError(f"kind {meta['kind']!r} has no page", do=f"train kind: {' or '.join(KINDS)}")
    if robot.rest_e is not None:
        meta = {**meta, "rest_e": robot.rest_e.tolist()}
    spec = spec.model_copy(update={"scalar": "double", "full": False})
    model, p = surrogate(meta, arrays, spec)
    if model.modules:
        what = "modules in a row under loads, of different models or with a centre of mass have no page"
        raise InputError(what, do="export C")
    predictor = model.reference
    points, chosen = watched(predictor), spec.controller
    if chosen.weights is None:  # a goal is a place: rotations follow
        dragged = [row for point in points for row in range(*point["rows"])]
        weights = np.isin(np.arange(predictor.rows.n_e), dragged).astype(float).tolist()
        chosen = chosen.model_copy(update={"weights": weights})
    defines, constants = controller(predictor, p, chosen, "double", robot.pressures)
    right = right_at_rest(predictor, constants, p)

    def block_of(variant: Predictor, its_skin: dict[str, np.ndarray]) -> bytes:
        its_model, _ = surrogate(variant.meta, variant.arrays, spec)
        _, its_constants = controller(variant, p, chosen, "double", robot.pressures)
        if right:
            its_constants |= with_rest(variant, its_constants, p)
        return block(its_model, defines, its_constants, skin_series(variant, its_skin, p))

    rest = np.zeros((int(right), predictor.rows.n_a))  # among the states that the reach is drawn from
    weighed = weight(predictor, skin, points[0]["rows"][0], block_of)
    drawn = body(skin, lines(meta["robot"], predictor.length), walls)
    facts = _facts(predictor, constants, drawn, points, chosen) | {"weight": weighed and weighed[1].largest}
    data = {
        "code": (ASSETS / "cfem.wasm").read_bytes(),
        "block": weighed[0] if weighed else block_of(predictor, skin),
        "rest": Fixed(drawn.rest, np.array([max(np.abs(drawn.rest).max() / 2**30, EXACT)])),
        "modes": drawn.modes.astype(np.float32),
        "triangles": drawn.triangles,
        "states": np.vstack([rest, predictor.domain.states[:, : predictor.rows.n_a]]),
    }
    runs = moves(meta, predictor, moving, spec.model_copy(update={"controller": chosen})) if moving else None
    if runs:
        facts["motion"] = runs.facts
        data |= {"motion": runs.block, "curve": runs.curve}
    if weighed:
        data |= {"positions": weighed[1].positions, "changes": weighed[1].changes}
    return fill(facts, data, meta["scene"], about(meta, predictor), concerns)


def _facts(
    predictor: Predictor,
    constants: dict[str, np.ndarray],
    drawn: DrawnBody,
    points: list[dict[str, Any]],
    chosen: FirmwareControllerSpec,
) -> dict[str, Any]:
    """Facts that the page's program is told beside the arrays."""
    return {
        "actuators": actuators(predictor, constants, predictor.meta.get("robot")),
        "points": points,
        "rest_e": predictor.rest_e.tolist(),
        "skin": len(drawn.modes),
        "room": room(),
        "length": predictor.length,
        "outer": drawn.outer,
        "chambers": [dict(zip(("actuator", "first", "count"), chamber, strict=True)) for chamber in drawn.chambers],
        "lines": [dict(zip(("actuator", "first", "count", "radius"), line, strict=True)) for line in drawn.lines],
        "command": chosen.command,
        "tolerance": constants["cfem_tolerance"].tolist(),
        "paced": chosen.rate is not None or chosen.force_rate is not None,
    }


def room() -> dict[str, int]:
    """Sizes of vectors in the memory of the page's program, and the ticks ahead that it has room for."""
    names = {"effector": "MOST_NE", "actuator": "MOST_NA", "skin": "MOST_SKIN", "ticks": "MPC_MOST_TICKS"}
    return {name: motion_layout().room[f"CFEM_{word}"] for name, word in names.items()}


def watched(predictor: Predictor) -> list[dict[str, Any]]:
    """The points that can be dragged: name, first row and the row behind the last. InputError where there is none."""
    points = []
    names = predictor.rows.effectors
    for row in range(len(names) - 2):
        name, _, axis = names[row].rpartition(".")
        if axis == "x" and names[row : row + 3] == tuple(f"{name}.{letter}" for letter in POINT):
            points.append({"name": name, "rows": [row, row + 3]})
    if not points:
        raise InputError("no effector is a point with rows x, y and z, so there is no goal to drag")
    return points


def actuators(
    predictor: Predictor, constants: dict[str, np.ndarray], robot: dict[str, Any] | None
) -> list[dict[str, Any]]:
    """Actuators as the page shows them. robot: what the model says of it, which tells pushes from cables; delta:
    smallest and largest, mm or mm^3; lambda: the same, N or MPa, null where open; scale: the largest force in the
    training states of an actuator of its kind, where the colours end."""
    largest, entries = np.abs(constants["cfem_domain_lambda_a"]).max(axis=0), []
    pushes = {item["name"] for item in (robot or {}).get("actuators", []) if item["kind"] == "push"}
    kinds = [
        "chamber" if unit != "mm" else "push" if name in pushes else "cable"
        for name, (unit, _) in zip(predictor.rows.actuators, predictor.actuator_units, strict=True)
    ]
    for i, (name, kind) in enumerate(zip(predictor.rows.actuators, kinds, strict=True)):
        chamber = kind == "chamber"
        low, high = (constants[f"cfem_lambda_{end}"][i] for end in ("low", "high"))
        entries.append(
            {
                "name": name,
                "kind": kind,
                "unit": "mm³" if chamber else "mm",
                "forceUnit": "kPa" if chamber else "N",
                "forceFactor": 1000 if chamber else 1,
                "delta": [float(constants[f"cfem_delta_{end}"][i]) for end in ("low", "high")],
                "lambda": [float(force) if np.isfinite(force) else None for force in (low, high)],
                "scale": float(largest[np.array(kinds) == kind].max()),
            }
        )
    return entries


def about(meta: dict, predictor: Predictor) -> str:
    """Sentences on the model for the reader."""
    known = ""
    if (stated := predictor.model_error) is not None:
        at_most = length(max(stated.tip.everywhere, LEAST))
        known = f" The tip is at most {at_most} off in {stated.percent} of the unseen states of its domain."
    if predictor.mesh_error is not None:
        low, high = (100 * share for share in predictor.mesh_error.tip.far)
        known += f" Its mesh adds {low:.2g} to {high:.2g} % of how far the tip travels (estimated)."
    return (
        f"A learned condensed finite-element model ({meta['kind']}) computes all that you see, on your device.{known} "
        "Nothing is sent anywhere. Made by cfem."
    )


def fill(facts: dict[str, Any], data: dict[str, Any], title: str, words: str, concerns: Sequence[str]) -> str:
    """The page of facts and the arrays of `data`."""
    packed = pack(facts, data)
    text = {
        "title": escape(title),
        "about": escape(words),
        "concerns": "".join(f'<p class="poor">{escape(concern)}</p>\n' for concern in concerns),
        "style": _asset("page.css") + viewer.asset("viewer.css"),
        "script": viewer.script(*map(_asset, SCRIPTS)),
        "bytes": packed.bytes,
        "crc": packed.crc,
        "data": packed.text,
    }
    first, *others = _asset("page.html").split("{{")
    split = (part.partition("}}") for part in others)
    return first + "".join(f"{text[name]}{rest}" for name, _, rest in split)


def _asset(name: str) -> str:
    return (ASSETS / name).read_text(encoding="utf-8")
