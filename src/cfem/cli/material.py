"""`cfem material list`, `show NAME`, `fit FILE`."""

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cfem.core.errors import SpecError

ACTIONS = ("list", "show", "fit")


def run_material(
    action: str, what: str | None, others: Mapping[str, Path | None], how: Mapping[str, Any], force: bool, as_json: bool
) -> dict[str, Any] | str:
    """Runs `cfem material`. what: name or file; others: files of further tests; how: as `Request` has it."""
    if action not in ACTIONS:
        raise SpecError(f"expected one of {', '.join(ACTIONS)}, got '{action}'", where="material")
    if action == "list":
        if what is not None:
            raise SpecError("takes no name", where="material list", do=f"use `cfem material show {what}`")
        return _list(as_json)
    if action == "show":
        return _show(_demanded(what, "the name of an elastomer", "show"), as_json)
    from cfem.identify.material.stage import Request, fit_material
    from cfem.identify.material.text import fit_text

    files = {"uniaxial": Path(what)} if what is not None else {}
    files |= {mode: path for mode, path in others.items() if path is not None}
    if not files:
        _demanded(None, "the table of a tensile test", "fit")
    fitted = fit_material(Request(files, **how), force)
    return fitted if as_json else fit_text(fitted)


def _demanded(what: str | None, kind: str, action: str) -> str:
    if what is None:
        raise SpecError(f"needs {kind}", where=f"material {action}")
    return what


def _list(as_json: bool) -> dict[str, Any] | str:
    from cfem.identify.material.catalogue import data_of, list_text
    from cfem.robot.elastomers import ELASTOMERS

    return {"elastomers": [data_of(name) for name in ELASTOMERS]} if as_json else list_text()


def _show(name: str, as_json: bool) -> dict[str, Any] | str:
    """Elastomer of the catalogue, as data or text. SpecError where there is none of this name."""
    from cfem.identify.material.catalogue import data_of, show_text
    from cfem.robot.elastomers import ELASTOMERS

    if name not in ELASTOMERS:
        near = difflib.get_close_matches(name, ELASTOMERS, n=1, cutoff=0.5)
        hint = f"did you mean '{near[0]}'?" if near else "`cfem material list` shows all"
        raise SpecError(f"no elastomer is called '{name}' ({hint})", where="material show")
    return data_of(name) if as_json else show_text(name)
