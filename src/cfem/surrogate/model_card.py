"""model.json: all that a user of a trained model must know besides its weights."""

from typing import Any

from cfem.condensed.model import Form
from cfem.core.artefact.files import plain
from cfem.core.artefact.provenance import versions
from cfem.predict.card import FORMAT
from cfem.predict.series.domain import Domain
from cfem.surrogate.series.observations import inputs

QUANTITIES = ("delta_a", "lambda_a", "delta_e", "W", "delta_free", "energy")


def model_card(kind: str, dataset: Any, form: Form = "displacement", **more: Any) -> dict[str, Any]:
    """Content of model.json. dataset: the training states (cfem.dataset.reader.Dataset); more: errors, history, what
    the kind needs to run."""
    meta = dataset.meta
    _, q = inputs(dataset, form)
    return plain(
        {
            "format": FORMAT,
            "kind": kind,
            "form": form,
            "scene": meta["scene"],
            "robot": meta.get("robot"),
            "rows": {"effectors": dataset.rows.effectors, "actuators": dataset.rows.actuators},
            "n_c": dataset.n_c,
            "patch": meta.get("patch"),
            "units": {name: meta["units"][name] for name in QUANTITIES},
            "row_units": meta["row_units"],
            "rest_e": meta["rest_e"],
            "reach": meta["reach"],
            "length": meta["length"],
            "parameters": meta.get("parameters", []),
            "domain": Domain.of(dataset.delta_a, dataset.lambda_a, q).to_json(),
            "versions": versions(),
            **({"masses": meta["masses"]} if "masses" in meta else {}),
            **more,
        }
    )
