"""What a run states of the error of its models' contact, and at how many goals it held."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cfem.condensed.model_error import ContactError
from cfem.core.console.shown import counted, length
from cfem.equilibrium.quasi_static import CONVERGED
from cfem.predict.contact.model import ContactModel

NOT_STATED = "where a state is not trusted, soft surfaces press at edges, or more touches than in the calibration"


def stated_errors(
    models: Mapping[str, ContactModel], places: int, records: Sequence[Mapping[str, Any]], rest_e: np.ndarray
) -> tuple[dict[str, Any], list[str]]:
    """Results by model, and a line each. records: rows of the table of goals, rest_e (n_e,) of all their rows, those of
    obstacles behind; places: that were asked for."""
    figures, lines = {}, []
    for name, model in models.items() if places else ():
        rows = [row for row in records if row["controller"] == name and row["plant_status"] == CONVERGED]
        if not model.stated:
            figures[name] = None
            lines.append(f"contact by {name}: no error stated, as none of {places} places told it")
            continue
        stated = model.stated[0].model_copy(update={"probability": min(each.probability for each in model.stated)})
        figures[name] = stated.model_dump(mode="json") | _held(model, rows, rest_e)
        lines.append(f"contact by {name}: {_sentence(stated, figures[name])}")
    return figures, lines


def _held(model: ContactModel, rows: Sequence[Mapping[str, Any]], rest_e: np.ndarray) -> dict[str, Any]:
    """Largest bounds at the goals (None without one), and at how many of them the plant was within."""
    known = [row for row in rows if np.isfinite(row["force_error"]) and np.isfinite(row["model_error"])]
    points, forces = ~np.array(model.rows.turns), [name.endswith(".force") for name in model.rows.effectors]
    points[len(model.patched.model.rest_e) :] = False
    within = 0
    for row in known:
        missed = np.array(row["x_e"]) - rest_e - row["predicted_e"]
        pressing = np.array(row["predicted_e"])[forces] > 0
        force_errors = np.abs(missed[forces][pressing])
        held = np.linalg.norm(missed[points]) <= row["model_error"] and (force_errors <= row["force_error"]).all()
        within += bool(held)
    largest = {key: max((row[key] for row in known), default=None) for key in ("force_error", "model_error")}
    return {"goals": len(rows), "stated": len(known), "within": within, "largest": largest}


def _sentence(stated: ContactError, figures: Mapping[str, Any]) -> str:
    """Sentence on the largest stated bounds, on what they are calibrated by, and at how many goals they held."""
    goals, known, largest = figures["goals"], figures["stated"], figures["largest"]
    if not known:
        return f"no error stated at {counted(goals, 'goal')}, {NOT_STATED}"
    single, several = (each.places if each else 0 for each in (stated.one, stated.several))
    text = (
        f"force of each obstacle within {largest['force_error']:.2g} N, tip within {length(largest['model_error'])} of "
        f"finite elements, with {stated.percent} (from {counted(single, 'random place')} of one rigid obstacle and "
        f"{several} of several, friction {stated.friction:g}); "
        f"it held at {figures['within']} of {counted(known, 'goal')}"
    )
    return text + (f", and is NOT stated at {goals - known}, {NOT_STATED}" if known < goals else "")
