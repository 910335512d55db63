"""Results of `cfem train`, made up."""

from typing import Any


def point(samples: int, loss: float, microseconds: float = 30.0) -> dict[str, Any]:
    spread = {"mean": loss, "max": 3 * loss, "rms": loss}
    return {
        "samples": samples,
        "seconds_fit": 0.01 * samples,
        "seconds_sampling": 0.1 * samples,
        "microseconds_query": microseconds,
        "errors": {"states": 20, "loss": loss, "tip_mm": spread, "force_N": spread},
    }


def series_history() -> list[dict[str, Any]]:
    return [
        {"quantity": quantity, "weights": weights, "degree": float(n), "terms": n + 1, "error": 0.5**n}
        for quantity in ("potential", "effector", "effector_compliance")
        for weights in ("equal", "searched", "decay")
        for n in range(5)
    ]


def epochs() -> list[dict[str, Any]]:
    return [{"epoch": e, "training": 1 / e, "validation": 2 / e} for e in (10, 20, 30)]


def trained(kind: str, form: str = "displacement", losses: tuple[float, ...] = (1e-2, 1e-4), **facts: Any) -> dict:
    """Results of a model trained on 10, 20, ... samples with these losses."""
    curve = [point(10 * (i + 1), loss) for i, loss in enumerate(losses)]
    history = series_history() if kind == "spectral" else epochs()
    definite = {"queries": 1000, "share": 1.0, "smallest_eigenvalue": 0.02, "where": {"s": [1.5, 2.0], "p": []}}
    return {
        "kind": kind,
        "form": form,
        **curve[-1],
        "learning_curve": curve,
        "history": history,
        "positive_definite": definite,
        "headline": [],
        **facts,
    }


class Text:
    """A part of a page that is what it says."""

    def __init__(self, html: str):
        self._html = html

    def html(self) -> str:
        return self._html
