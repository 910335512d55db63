"""Whether a control run went by the models that the page shows beside it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError


def demand_used(run: Path, manifest: Mapping[str, Any], shown: Mapping[str, str]) -> None:
    """Raises InputError where the run used a model that is none of those shown, by name their content hashes. Used is
    what the run's manifest recorded: a trained model, or what was exported of one."""
    recorded = (manifest.get("origin") or {}).get("inputs") or {}
    for name, content in recorded.items():
        if name.partition(" ")[0] != "model" or content in shown.values():
            continue
        trained = _trained(run / manifest["inputs"][name], content)
        if trained is None or trained in shown.values():
            continue
        what = f"its run used a {name} that is not the one shown ({', '.join(shown)})"
        raise InputError(what, where=str(run), do="name the models that it used, or run cfem control again")


def _trained(folder: Path, content: str) -> str | None:
    """Content of the model that an export of this content was made from; None where that is no longer there."""
    try:
        manifest = read_manifest(folder)
    except InputError:
        return None
    if manifest["content"] != content:
        return None
    if manifest["stage"] != "export":
        return content
    return ((manifest.get("origin") or {}).get("inputs") or {}).get("model")
