"""`cfem material`: list, show, and fit. The place that reads and writes files."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.parameters import number_in
from cfem.core.artefact.files import finite, write_json, write_whole
from cfem.core.artefact.judgement import KEY, poor
from cfem.core.console.shown import stress
from cfem.core.errors import OutputError, SpecError
from cfem.identify.material.choose import Candidate, candidates, choose
from cfem.identify.material.constants import as_yaml, intervals, scene_material
from cfem.identify.material.curve import Curve, read_curve, up_to
from cfem.identify.material.fit import LawFit
from cfem.identify.material.forms import FORMS, Form, Mode
from cfem.robot.checks.plausible import RUBBER, modulus_doubts

DEFAULT = tuple(name for name in FORMS if name != "ogden-3")
_SQUEEZED = 0.01  # strain beyond which a specimen is compressed
STRENGTH = 100.0  # MPa of tension over the area at rest: above what the strongest rubbers bear
MISSED = 0.1  # rms over the largest stress: a law that misses by more does not describe the curve
FILES = ("material.yaml", "fit.json", "fit.png")


@dataclass(frozen=True)
class Request:
    """Request to `cfem material fit`.

    files:   table of each mode that was tested
    length, area: of the specimen, as a user writes them
    most:    stretch up to which the curves count, None for all
    slack:   whether the specimen may be slack at first
    law:     of FORMS, None to choose
    poisson: Poisson's ratio that the scene gets
    out:     folder for the files, None for none"""

    files: Mapping[Mode, Path]
    length: str | None = None
    area: str | None = None
    most: float | None = None
    slack: bool = False
    law: str | None = None
    poisson: float = 0.499
    out: Path | None = None


def fit_material(request: Request, force: bool = False) -> dict[str, Any]:
    """The law that the curves support, as plain data; writes FILES where a folder is asked for, which `force` may
    replace. SpecError where the request does not fit the curves."""
    forms = _forms(request.law)
    if not 0 <= request.poisson < 0.5:
        raise SpecError("Poisson's ratio must be from 0 to 0.4999", where="--poisson")
    _demand_free(request, force)
    curves = _read(request)
    if request.slack and "uniaxial" not in request.files:
        raise SpecError(
            "--slack needs a uniaxial test", where="--slack", do="give the table of one, or leave --slack out"
        )
    if request.slack and any(curve.mode == "uniaxial" and curve.stretch[0] < 1 - _SQUEEZED for curve in curves):
        raise SpecError("--slack is of a specimen that is pulled taut", where="--slack", do="leave it out")
    tried = candidates(forms, curves, request.slack)
    if not tried:
        points = sum(len(curve.stretch) for curve in curves)
        raise SpecError(f"{points} points are too few for {request.law}", where="--law", do="choose a smaller law")
    chosen = choose(tried)
    results = _results(curves, tried, chosen, request)
    if request.out is not None:
        _write(request.out, results, curves, tried, chosen)
    return results


def _forms(law: str | None) -> list[Form]:
    """The form that was asked for, or all that are tried unless told otherwise."""
    if law is not None and law not in FORMS:
        raise SpecError(f"no law is called '{law}'", where="--law", do=f"use one of {', '.join(FORMS)}")
    return [FORMS[name] for name in ((law,) if law else DEFAULT)]


def _read(request: Request) -> list[Curve]:
    """The curves of all tests, up to the stretch that was asked for."""
    length, area = _size(request.length, "mm", "--length"), _size(request.area, "mm^2", "--area")
    curves = [read_curve(path, mode, length, area) for mode, path in request.files.items()]
    return curves if request.most is None else [up_to(curve, request.most) for curve in curves]


def _size(text: str | None, unit: str, option: str) -> float | None:
    """A size in `unit`, None for none. SpecError naming the option where it is no size above zero."""
    if text is None:
        return None
    value = number_in(unit, text, option)
    if not value > 0:
        raise SpecError("must be greater than 0", where=option)
    return value


def _demand_free(request: Request, force: bool) -> None:
    if request.out is None or force:
        return
    held = [name for name in FILES if (request.out / name).exists()]
    if held:
        raise OutputError(f"holds {', '.join(held)}", where=str(request.out), do="choose another folder, or --force")


def _results(curves: list[Curve], tried: list[Candidate], chosen: Candidate, request: Request) -> dict[str, Any]:
    """Law, constants with intervals, curves, all laws that were tried, and how far the law can be trusted."""
    fit = chosen.fit
    material = scene_material(fit, request.poisson)
    constants = {name: [value, finite(half)] for name, (value, half) in intervals(fit).items()}
    return {
        KEY: [poor(what) for what in _doubts(curves, fit)],
        "material": material,
        "scene": f"material: {as_yaml(material)}",
        "law": fit.form.name,
        "stretch": [
            float(min(curve.stretch[0] for curve in curves)),
            float(max(curve.stretch[-1] for curve in curves)),
        ],
        "young MPa": constants["young"],
        "slack": constants.get("slack"),
        "constants": constants,
        "rms MPa": fit.rms,
        "curves": [
            {
                "file": curve.source,
                "mode": curve.mode,
                "sense": curve.sense,
                "points": len(curve.stretch),
                "largest stress MPa": float(curve.stress[np.argmax(np.abs(curve.stress))]),
            }
            for curve in curves
        ],
        "tried": [_row(candidate, candidate is chosen) for candidate in tried],
        "stable to": fit.stable,
        "not measured": [mode for mode in ("biaxial", "planar") if mode not in request.files],
    }


def _doubts(curves: list[Curve], fit: LawFit) -> list[str]:
    """Sentences on units that can hardly be meant, and on a law that misses its curves."""
    titles = ", ".join(f"'{curve.title}' in {curve.source}" for curve in curves)
    sentences = modulus_doubts(fit.young, RUBBER, f"check the unit of {titles}")
    pulled = max(float(curve.stress.max()) for curve in curves)
    largest = max(float(np.abs(curve.stress).max()) for curve in curves)
    if pulled > STRENGTH and not sentences:
        what = f"the stress reaches {stress(pulled)}, and no rubber bears more than about {stress(STRENGTH)}"
        sentences.append(f"{what}: check the unit of {titles}")
    if fit.rms > MISSED * largest:
        share = f"{100 * fit.rms / largest:.0f} % of the largest stress"
        sentences.append(f"{fit.form.name} misses the curve by {share} (rms): look for points that are not of it")
    return sentences


def _row(candidate: Candidate, chosen: bool) -> dict[str, Any]:
    """The account of a law that was tried."""
    return {
        "law": candidate.fit.form.name,
        "constants": candidate.fit.form.constants,
        "rms MPa": candidate.fit.rms,
        "unseen MPa": candidate.held_out,
        "unseen error MPa": candidate.held_out_error,
        "aicc": finite(candidate.aicc),
        "young MPa": candidate.fit.young,
        "stable": candidate.fit.is_stable,
        "signs held": candidate.fit.held,
        "chosen": chosen,
    }


def _write(out: Path, results: dict[str, Any], curves: list[Curve], tried: list[Candidate], chosen: Candidate) -> None:
    """Writes the files of a fit, FILES."""
    from cfem.identify.material.figure import fit_figure

    sources = ", ".join(curve.source for curve in curves)
    low, high = results["stretch"]
    head = f"# Fitted by `cfem material fit` to {sources}, stretch {low:.3g} to {high:.3g}.\n"
    write_whole(out / "fit.png", fit_figure(curves, tried, chosen))
    write_json(out / "fit.json", results)
    write_whole(out / "material.yaml", (head + results["scene"] + "\n").encode())
