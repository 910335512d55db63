"""Hyper-parameter search: tree-structured Parzen estimation with median pruning, by optuna.

A trial is a function of the finished ones and of the seed alone, so a search that goes on from its table ends as one
that was never interrupted; a limit in seconds is all that can make two of them differ."""

import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cfem.core.artefact.files import write_whole
from cfem.core.errors import NumericalError
from cfem.surrogate.spec import MlpRanges, MlpSearch

LOGARITHMIC = {"width", "batch_size", "learning_rate"}
Report = Callable[[int, float], None]
Judge = Callable[[dict[str, Any], Report], float]


def search(judge: Judge, spec: MlpSearch, seed: int, table: Path | None = None) -> dict[str, Any]:
    """Result of a search. choice: the best one; trials: number, choice, state (complete, pruned, diverged) and loss of
    each.

    judge(choice, report): the loss of a choice, on validation rows. It calls report(epoch, loss) on its way, which ends
    the trials that are worse than half of the earlier ones were, and raises NumericalError where training diverges.
    table: a file that keeps the finished trials; the one under way when the search was killed is repeated.
    NumericalError where none ended well."""
    trials, spent = _read(table)
    while len(trials) < spec.trials and (spec.seconds is None or spent < spec.seconds):
        begin = time.perf_counter()
        trials.append(_trial(judge, spec, seed, trials))
        spent += time.perf_counter() - begin
        if table is not None:
            write_whole(table, json.dumps({"seconds": spent, "trials": trials}).encode())
    complete = [trial for trial in trials if trial["state"] == "complete"]
    if not complete:
        raise NumericalError(f"all {len(trials)} trials failed", do="lower the learning rates in model.search.over")
    best = min(complete, key=lambda trial: trial["loss"])
    shown = [{name: value for name, value in trial.items() if name != "path"} for trial in trials]
    return {"choice": best["choice"], "trials": shown}


def _trial(judge: Judge, spec: MlpSearch, seed: int, finished: list[dict]) -> dict[str, Any]:
    """Record of one trial: the sampler's choice, judged; pruned where its path is worse than the median."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    ranges = _distributions(spec.over)
    study = optuna.create_study(
        sampler=optuna.samplers.TPESampler(seed=seed + len(finished)),
        pruner=optuna.pruners.MedianPruner(n_warmup_steps=spec.epochs // 4),
    )
    study.add_trials([_frozen(trial, ranges) for trial in finished])
    trial = study.ask(ranges)
    path: dict[str, float] = {}

    def report(epoch: int, loss: float) -> None:
        path[str(epoch)] = loss
        trial.report(loss, epoch)
        if trial.should_prune():
            raise optuna.TrialPruned

    record = {"number": len(finished), "choice": trial.params, "state": "complete", "loss": None, "path": path}
    try:
        record["loss"] = judge(trial.params, report)
    except optuna.TrialPruned:
        record["state"] = "pruned"
    except NumericalError:
        record["state"] = "diverged"
    return record


def _frozen(trial: dict[str, Any], ranges: dict[str, Any]) -> Any:
    """A row of the table as optuna's own. One that diverged counts as pruned, with an infinite loss at its end."""
    import optuna

    path = {int(epoch): loss for epoch, loss in trial["path"].items()}
    if trial["state"] == "diverged":
        path[max(path, default=0) + 1] = math.inf
    state = optuna.trial.TrialState
    return optuna.trial.create_trial(
        state=state.COMPLETE if trial["state"] == "complete" else state.PRUNED,
        value=trial["loss"] if trial["state"] == "complete" else list(path.values())[-1],
        params=trial["choice"],
        distributions=ranges,
        intermediate_values=path,
    )


def _distributions(over: MlpRanges) -> dict[str, Any]:
    """Ranges that are given, in optuna's form."""
    from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution

    distributions: dict[str, Any] = {}
    for name in type(over).model_fields:
        values = getattr(over, name)
        if values is None:
            continue
        if isinstance(values[0], str):
            distributions[name] = CategoricalDistribution(values)
        else:
            kind = IntDistribution if isinstance(values[0], int) else FloatDistribution
            distributions[name] = kind(*values, log=name in LOGARITHMIC)
    return distributions


def _read(table: Path | None) -> tuple[list[dict], float]:
    if table is None or not table.exists():
        return [], 0.0
    data = json.loads(table.read_text(encoding="utf-8"))
    return data["trials"], data["seconds"]
