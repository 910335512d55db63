"""Results that nobody should trust say so first, and so does all that is made from them.

A stage puts `judgement`, a list of `poor(...)` and `contradicted(...)`, into its results; `run_stage` adds those of the
stage's inputs. Commands print them before anything else. Exit code 4: with --strict for any, always for a contradiction
of the stage's own."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError, NumericalError
from cfem.core.kinds import present

# Rows fail at the edge of the reach first: beyond 1 in 20 the rest no longer covers the reach that the spec states.
FAILED_SHARE = 0.05
# Mean squared error in units of each entry's variance: above it a model explains less than 99 % of what it should.
LOSS = 1e-2
# Share of random states with an indefinite W: at 1 in 100 a trajectory meets one, where the inverse step is not convex.
INDEFINITE_SHARE = 1e-2
# Residuals in units of the stated noise: beyond this the model explains less than the noise allows, by far.
NOISE_RATIO = 3.0
# |model - FE| of an objective, as a share of its spread over all designs and of its value: where both are above it, the
# model neither ranks designs nor states what they do.
DESIGN_GAP = 0.1

# Share of the actuator forces, or of the effectors' travel, that the mesh may leave uncertain, as estimated: a fifth.
UNCERTAIN = 0.2

KEY = "judgement"


def poor(what: str) -> dict[str, Any]:
    """Finding that a result should not be trusted."""
    return {"what": what}


def contradicted(what: str) -> dict[str, Any]:
    """Finding that a better method contradicts a result."""
    return {"what": what, "contradicted": True}


def with_inherited(results: Mapping[str, Any], inputs: Mapping[str, Path]) -> dict[str, Any]:
    """The results, judged as their stage did and as the artefacts that they were made from were."""
    judged = list(results.get(KEY, []))
    for path in inputs.values():
        judged += [finding for finding in _of_artefact(path) if finding not in judged]
    rest = {key: value for key, value in results.items() if key != KEY}
    return {KEY: judged, **rest} if judged else rest


def _of_artefact(path: Path) -> list[dict[str, Any]]:
    try:
        manifest = read_manifest(path) if path.is_dir() else {}
    except InputError:
        return []
    findings = _judged(manifest.get("results"))
    return [{"what": finding["what"], "from": finding.get("from", manifest["stage"])} for finding in findings]


def _judged(results: Any) -> list[dict[str, Any]]:
    """Findings of results, which may come from anywhere: what is no judgement is none."""
    findings = results.get(KEY) if isinstance(results, Mapping) else None
    return [
        finding
        for finding in (findings if isinstance(findings, list) else [])
        if isinstance(finding, dict) and isinstance(finding.get("what"), str)
    ]


def sentences(results: Mapping[str, Any]) -> list[str]:
    """Sentences for the first lines of whatever shows these results."""
    return [_sentence(finding) for finding in _judged(results)]


def _sentence(finding: Mapping[str, Any]) -> str:
    if "from" in finding:
        return f"POOR input, by cfem {present(finding['from'])}: {finding['what']}"
    return f"{'WRONG' if finding.get('contradicted') else 'POOR'}: {finding['what']}"


def demand_trust(results: Mapping[str, Any], strict: bool) -> None:
    """Raises NumericalError where something is contradicted or, if `strict`, poor. The results are kept."""
    against = [finding for finding in _judged(results) if strict or finding.get("contradicted")]
    if against:
        more = f"; and {len(against) - 1} more" if len(against) > 1 else ""
        why = "" if any(finding.get("contradicted") for finding in against) else "; without --strict the exit code is 0"
        raise NumericalError(f"{_sentence(against[0])}{more}", do=f"the output is kept{why}")
