"""Contents of an artefact, in lines for a person."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from cfem.core.artefact.judgement import sentences
from cfem.core.artefact.manifest import read_manifest
from cfem.core.console.shown import duration, folded


def describe(artefact: Path, as_json: bool = False) -> dict[str, Any] | str:
    """Text on an artefact: origin, figures and, for a dataset, statistics of every column. InputError where it is no
    artefact."""
    manifest = read_manifest(artefact)
    if as_json:
        return manifest
    version = manifest["versions"].get("cfem", "of unknown version")
    lines = [
        *sentences(manifest["results"]),
        f"{artefact}: made by cfem {manifest['stage']} {version}, in {duration(manifest['seconds'])}",
        f"  content   {manifest['content']}",
        f"  made from {manifest['made_from']}",
        *(f"  input     {name}: {path}" for name, path in manifest["inputs"].items()),
        *(f"  file      {name}" for name in manifest["files"]),
        *figures(manifest["results"]),
    ]
    if manifest["stage"] == "sample":
        from cfem.dataset.inspect import describe as describe_dataset

        lines.append(describe_dataset(artefact))
    return "\n".join(lines)


def figures(results: dict[str, Any]) -> list[str]:
    """The headline where there is one, else one aligned line a number or short text; the rest is in the manifest."""
    if "headline" in results:
        return [part for line in results["headline"] for part in folded(f"  {line}")]
    rows = list(_flat(results, ""))
    width = max((len(name) for name, _ in rows), default=0)
    return [f"  {name:<{width}}  {value}" for name, value in rows]


def _flat(node: dict[str, Any], prefix: str) -> Iterator[tuple[str, str]]:
    """Keys with dots and values of a nested mapping, long lists left out."""
    for key, value in node.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        elif isinstance(value, bool | int | str):
            yield prefix + key, str(value)
        elif isinstance(value, float):
            yield prefix + key, f"{value:.6g}"
        elif isinstance(value, list) and len(value) <= 6 and all(isinstance(item, int | float) for item in value):
            yield prefix + key, " ".join(f"{item:.6g}" for item in value)


def summarise(folders: Sequence[Path]) -> str:
    """Text of headlines, then seconds of every stage and their sum, then the report's page where there is one."""
    manifests = [read_manifest(folder) for folder in folders]
    judged = dict.fromkeys(line for manifest in manifests for line in sentences(manifest["results"]))
    lines_of_results = [*judged, *(line for manifest in manifests for line in manifest["results"].get("headline", []))]
    lines = [part for line in lines_of_results for part in folded(line)]
    lines += [f"{m['stage']:<16} {m['seconds']:7.1f} s   {path}" for m, path in zip(manifests, folders, strict=True)]
    lines.append(f"{'together':<16} {sum(m['seconds'] for m in manifests):7.1f} s")
    pages = [
        folder / m["results"]["page"] for m, folder in zip(manifests, folders, strict=True) if "page" in m["results"]
    ]
    return "\n".join([*lines, *(f"report: {page.resolve()}" for page in pages)])
