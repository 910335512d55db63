"""Choices that a model made while it was trained, in the words of the field and with units."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from cfem.core.console.shown import duration, length
from cfem.report.tables import ReportTable, number

# Of a result of `cfem train`, all but these is what the kind of model chose for itself.
COMMON = {
    "kind", "form", "samples", "seconds_fit", "seconds_sampling", "microseconds_query", "errors", "history",
    "positive_definite", "learning_curve", "headline", "module", "judgement", "mesh_error", "model_error",
}  # fmt: skip
QUANTITIES = {
    "potential": "energy",
    "effector": "position of the effectors",
    "effector_compliance": "compliance of the effectors",
    "rows": "displacement of the surface",
    "compliance": "compliance of the surface",
    "M": "mass",
    "F0": "viscosity",
    "F1": "viscosity, second rate",
    "H": "motion of the effectors",
    "curve": "curvature of that motion",
    "skin": "motion of the surface",
}


def choice_table(models: Mapping[str, Mapping[str, Any]]) -> ReportTable:
    """Table of the choices made for each model, one a row. models: results of `cfem train` by name."""
    rows = [(name, what, value) for name, results in models.items() for what, value in _chosen(results)]
    if len(models) > 1:
        return ReportTable(("model", "property", "value"), rows, words=True)
    return ReportTable(("property", "value"), [row[1:] for row in rows], words=True)


def _chosen(results: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for name, value in results.items():
        if name not in COMMON and value not in (None, {}, []):
            label, show = SAID.get(name, (_words(name), _plain))
            yield label, show(value)


def _by_quantity(values: Mapping[str, Any]) -> str:
    return "; ".join(f"{QUANTITIES.get(name, _words(name))}: {_plain(value)}" for name, value in values.items())


def _skin(skin: Mapping[str, Any]) -> str:
    fitted = f"; fitted in {duration(skin['seconds_fit'])}" if "seconds_fit" in skin else ""
    return (
        f"{skin['nodes']} nodes in {skin['modes']} modes; error at the test states {length(skin['rms_mm'])} rms, "
        f"{length(skin['largest_mm'])} at most ({number(skin['largest_percent_of_length'], 2)} % of the length){fitted}"
    )


def _motion(motion: Mapping[str, Any]) -> str:
    return f"{motion['inner']} inner motions; terms: {_by_quantity(motion['terms'])}"


def _plain(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{_words(name)} {_plain(part)}" for name, part in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(_plain(part) for part in value)
    return number(value, 2) if isinstance(value, float) else str(value)


def _words(name: str) -> str:
    return name.replace("_", " ")


# What a choice is called, and how its value is shown; one that is not here keeps its own name.
SAID: dict[str, tuple[str, Callable[[Any], str]]] = {
    "terms": ("terms of the Chebyshev series", _by_quantity),
    "weights": (
        "weight of each input direction in the degree of the series (2: half the degree along it)",
        _by_quantity,
    ),
    "locked_compliance": (
        "smallest eigenvalue of the effectors' compliance with the actuators locked, as a share of the free one",
        _plain,
    ),
    "skin": ("surface", _skin),
    "motion": ("motion", _motion),
    "best_epoch": ("epoch of the smallest validation loss", _plain),
    "validation_loss": ("validation loss (standardised mean square)", _plain),
    "at_rest": ("model at rest, by the parameters", lambda card: str(card.get("kind", "")) or _plain(card)),
    "activation": ("activation", _plain),
}
