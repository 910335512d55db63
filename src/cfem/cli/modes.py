"""`cfem modes`: natural frequencies and damping of a learned model along its workspace."""

from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import SpecError
from cfem.core.units import parse_number


def modes(
    folder: Path, displacements: Sequence[str] = (), free: bool = False, count: int = 3, picture: Path | None = None
) -> dict[str, Any]:
    """Frequencies (Hz) and damping at training states from rest outwards, or at given displacements 'a, b'."""
    from cfem.motion.error import frequency_error_of
    from cfem.motion.load import load_motion
    from cfem.motion.workspace import outwards, vibrations

    model = load_motion(folder)
    rows = vibrations(model, _given(displacements, model.n_a) if displacements else outwards(model), free, count)
    results = {"actuators": "free" if free else "held", "units": {"frequency": "Hz"}, "states": rows}
    if (stated := frequency_error_of(model.static.meta.get("motion"))) is not None:
        results["frequency_error"] = stated.model_dump(mode="json")
    if picture is not None:
        _draw(rows, picture, results["actuators"])
        results["picture"] = str(picture)
    return results


def as_text(results: dict[str, Any]) -> str:
    """Table of the frequencies."""
    from cfem.motion.error import frequency_error_of

    lines = [f"actuators {results['actuators']}: natural frequencies in Hz, and damping in % of the critical"]
    if "frequency_error" in results:
        lines[0] += f"; ±: {frequency_error_of(results).words}"
    for row in results["states"]:
        where = ", ".join(f"{value:.4g}" for value in row["delta_a"])
        modes_of_row = zip_longest(row["frequency"], row["damping"], row.get("frequency_error") or ())
        pairs_text = "   ".join(_in_words(*mode) for mode in modes_of_row if mode[0] is not None) or row["why"]
        if row.get("frequency_error", ()) is None:
            pairs_text += "   OUTSIDE"
        lines.append(f"{where:>30}   {pairs_text}")
    return "\n".join(lines)


def _in_words(frequency: float, damping: float, error: float | None) -> str:
    known = "" if error is None else f" ± {100 * error:.2g} %"
    return f"{frequency:8.3f}{known} ({100 * damping:.2f} %)"


def _given(displacements: Sequence[str], n_a: int) -> list[np.ndarray]:
    """Displacements (n_a,) mm from the options. SpecError where these are not so many finite numbers."""
    states = []
    for text in displacements:
        try:
            delta = np.array([parse_number(part) for part in text.split(",")])
        except ValueError:
            raise SpecError(f"--at {text}: expected numbers between commas") from None
        if len(delta) != n_a or not np.isfinite(delta).all():
            raise SpecError(f"--at {text}: expected {n_a} finite displacements, one an actuator")
        states.append(delta)
    return states


def _draw(rows: list[dict[str, Any]], path: Path, actuators: str) -> None:
    """Draws the frequencies over the states into a file."""
    from cfem.core.optional import demand

    demand("matplotlib", where="--picture")
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
    places = [i for i, row in enumerate(rows) if row["frequency"]]
    for mode, values in enumerate(zip(*(rows[i]["frequency"] for i in places), strict=True)):
        axes.plot(places, values, marker="o", label=f"mode {mode + 1}")
    labels = [", ".join(f"{value:.3g}" for value in row["delta_a"]) for row in rows]
    axes.set(
        xticks=range(len(rows)), xlabel="displacement of the actuators", ylabel="natural frequency, Hz", ylim=(0, None)
    )
    axes.set_xticklabels(labels)
    axes.set_title(f"actuators {actuators}")
    axes.legend()
    figure.savefig(path, dpi=150)
    plt.close(figure)
