"""`cfem material`: list, show, and fit. The place that reads and writes files."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import OutputError, SpecError
from cfem.core.files import write_json, write_whole
from cfem.core.judgement import KEY, poor
from cfem.core.units import parse_quantity
from cfem.robot.plausible import RUBBER, modulus_doubts
from cfem.tensile.choose import Candidate, candidates, choose
from cfem.tensile.constants import as_yaml, intervals, scene_material
from cfem.tensile.curve import Curve, read_curve, up_to
from cfem.tensile.forms import FORMS, Form, Mode

DEFAULT = tuple(name for name in FORMS if name != "ogden-3")
_SQUEEZED = 0.01  # strain beyond which a specimen is compressed
FILES = ("material.yaml", "fit.json", "fit.png")


@dataclass(frozen=True)
class Request:
    """files: of each mode that was tested; length, area: of the specimen, as a user writes them; most: stretch; law: of
    FORMS, None to choose; out: folder for the files, None for none."""

    files: Mapping[Mode, Path]
    length: str | None = None
    area: str | None = None
    most: float | None = None
    slack: bool = False
    law: str | None = None
    poisson: float = 0.499
    out: Path | None = None


def fit_material(request: Request, force: bool = False) -> dict[str, Any]:
    """What was found, as plain data. Writes FILES where asked."""
    forms = _forms(request.law)
    if not 0 <= request.poisson < 0.5:
        raise SpecError("Poisson's ratio must be from 0 to 0.4999", where="--poisson")
    _demand_free(request, force)
    curves = _read(request)
    if request.slack and "uniaxial" not in request.files:
        raise SpecError(
            "--slack needs a uniaxial test", where="--slack", do="give the table of one, or leave --slack out"
        )
    if request.slack and any(one.mode == "uniaxial" and one.stretch[0] < 1 - _SQUEEZED for one in curves):
        raise SpecError("--slack is of a specimen that is pulled taut", where="--slack", do="leave it out")
    tried = candidates(forms, curves, request.slack)
    if not tried:
        points = sum(len(one.stretch) for one in curves)
        raise SpecError(f"{points} points are too few for {request.law}", where="--law", do="choose a smaller law")
    chosen = choose(tried)
    found = _data(curves, tried, chosen, request)
    if request.out is not None:
        _write(request.out, found, curves, tried, chosen)
    return found


def _forms(law: str | None) -> list[Form]:
    if law is not None and law not in FORMS:
        raise SpecError(f"no law is called '{law}'", where="--law", do=f"use one of {', '.join(FORMS)}")
    return [FORMS[name] for name in ((law,) if law else DEFAULT)]


def _read(request: Request) -> list[Curve]:
    length, area = (
        _size(text, unit, option)
        for text, unit, option in ((request.length, "mm", "--length"), (request.area, "mm^2", "--area"))
    )
    curves = [read_curve(path, mode, length, area) for mode, path in request.files.items()]
    return curves if request.most is None else [up_to(one, request.most) for one in curves]


def _size(text: str | None, unit: str, option: str) -> float | None:
    if text is None:
        return None
    try:
        value = parse_quantity(text, unit)
    except ValueError as error:
        raise SpecError(str(error), where=option) from None
    if not value > 0:
        raise SpecError("must be greater than 0", where=option)
    return value


def _demand_free(request: Request, force: bool) -> None:
    if request.out is None or force:
        return
    there = [name for name in FILES if (request.out / name).exists()]
    if there:
        raise OutputError(f"holds {', '.join(there)}", where=str(request.out), do="choose another folder, or --force")


def _data(curves: list[Curve], tried: list[Candidate], chosen: Candidate, request: Request) -> dict[str, Any]:
    fit = chosen.fit
    material = scene_material(fit, request.poisson)
    titles = ", ".join(f"'{one.title}' in {one.source}" for one in curves)
    return {
        KEY: [poor(what) for what in modulus_doubts(fit.young, RUBBER, f"check the unit of {titles}")],
        "material": material,
        "scene": f"material: {as_yaml(material)}",
        "law": fit.form.name,
        "stretch": [float(min(one.stretch[0] for one in curves)), float(max(one.stretch[-1] for one in curves))],
        "young MPa": list(_known(intervals(fit)["young"])),
        "slack": list(_known(intervals(fit)["slack"])) if fit.with_slack else None,
        "constants": {name: list(_known(one)) for name, one in intervals(fit).items()},
        "rms MPa": fit.rms,
        "curves": [
            {
                "file": one.source,
                "mode": one.mode,
                "sense": one.sense,
                "points": len(one.stretch),
                "largest stress MPa": float(one.stress[np.argmax(np.abs(one.stress))]),
            }
            for one in curves
        ],
        "tried": [_row(one, one is chosen) for one in tried],
        "stable to": fit.stable,
        "not measured": [mode for mode in ("biaxial", "planar") if mode not in request.files],
    }


def _known(interval: tuple[float, float]) -> tuple[float, float | None]:
    value, half = interval
    return value, half if np.isfinite(half) else None


def _row(one: Candidate, chosen: bool) -> dict[str, Any]:
    return {
        "law": one.fit.form.name,
        "constants": one.fit.form.constants,
        "rms MPa": one.fit.rms,
        "unseen MPa": one.held_out,
        "unseen error MPa": one.held_out_error,
        "aicc": one.aicc if np.isfinite(one.aicc) else None,
        "young MPa": one.fit.young,
        "stable": one.stable,
        "signs held": one.fit.held,
        "chosen": chosen,
    }


def _write(out: Path, found: dict[str, Any], curves: list[Curve], tried: list[Candidate], chosen: Candidate) -> None:
    from cfem.tensile.figure import fit_figure

    sources = ", ".join(one.source for one in curves)
    low, high = found["stretch"]
    head = f"# Fitted by `cfem material fit` to {sources}, stretch {low:.3g} to {high:.3g}.\n"
    write_whole(out / "fit.png", fit_figure(curves, tried, chosen))
    write_json(out / "fit.json", found)
    write_whole(out / "material.yaml", (head + found["scene"] + "\n").encode())
