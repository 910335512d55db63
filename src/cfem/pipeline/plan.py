"""Plan of the commands that make a robot's results, in order: every spec comes after those that make what it reads."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cfem.core.artefact.chain import describe
from cfem.core.artefact.stage_run import Stage
from cfem.core.errors import InputError, SpecError
from cfem.core.kinds import KINDS, present

_OUT = re.compile(r"""^out:[ \t]*(?:"([^"\n]+)"|'([^'\n]+)'|([^#\n]+?))[ \t]*(?:\#.*)?$""", re.MULTILINE)


@dataclass(frozen=True)
class Step:
    """A command of a pipeline."""

    kind: str  # of its spec
    spec: Path
    stage: Stage
    needs: tuple[Path, ...]  # the specs of the steps whose results it reads
    quick: bool = False  # whether it gives a coarse answer (quick.py)

    @property
    def command(self) -> str:
        return KINDS[self.kind][2]


def kind_of(spec: Path) -> str | None:
    """Kind of a spec by the file's name: train.yaml and train-large.yaml are of kind train."""
    kind = spec.stem.split("-")[0]
    return kind if spec.suffix == ".yaml" and kind in KINDS else None


def kind_named(word: str) -> str:
    """Kind of this name, or of the command of this name: 'design', 'optimize-design'. SpecError where it is neither."""
    commands, name = {command: kind for kind, (_, _, command) in KINDS.items()}, present(word)
    if name not in KINDS and name not in commands:
        raise SpecError(f"'{word}' is no stage", do=f"use one of {', '.join(commands)}")
    return commands.get(name, name)


def own_specs(folder: Path) -> list[Path]:
    """The specs of a folder that have no suffix, in the order of the pipeline: train.yaml, not train-large.yaml.
    InputError where there is none."""
    if not folder.is_dir():
        raise InputError("no such folder", where=str(folder), do="name a folder of specs, or a spec")
    specs = [folder / f"{kind}.yaml" for kind in KINDS if (folder / f"{kind}.yaml").is_file()]
    if not specs:
        raise InputError(
            f"holds none of {', '.join(f'{kind}.yaml' for kind in KINDS)}",
            where=str(folder),
            do="name a folder of specs, such as pipelines/soft-finger",
        )
    return specs


def plan(goals: Sequence[Path], overrides: Mapping[Path, Sequence[str]], follow: bool = True) -> list[Step]:
    """The steps of these specs and, where `follow`, of all specs that make what they read; each once, in order.
    overrides: by spec. InputError where an input is missing that no spec makes."""
    steps: dict[Path, Step] = {}
    outs: dict[Path, dict[str, Path]] = {}

    def visit(spec: Path, above: tuple[Path, ...]) -> None:
        """Adds the step of a spec after those that it needs. SpecError where a spec needs its own result."""
        real = spec.resolve()
        if real in above:
            raise SpecError("needs its own result", where=str(spec), do="look at its inputs and at `out`")
        if real in steps:
            return
        kind = kind_of(spec)
        if kind is None and not spec.exists():
            raise InputError("no such folder or spec", where=str(spec), do="check the path")
        if kind is None:
            what = f"its name begins with none of {', '.join(KINDS)}"
            raise SpecError(what, where=str(spec), do="rename it, or give it to its own command")
        try:
            stage = describe(kind, spec, tuple(overrides.get(spec, ())))
        except InputError as error:
            raise _naming_maker(error, spec.parent, outs) from None
        needs = tuple(_makers(stage, spec, outs)) if follow else ()
        for maker in needs:
            visit(maker, (*above, real))
        steps[real] = Step(kind, spec, stage, needs)

    for goal in goals:
        visit(goal, ())
    return list(steps.values())


def _makers(stage: Stage, spec: Path, outs: dict[Path, dict[str, Path]]) -> Iterator[Path]:
    """The specs that make the inputs: those of the same folder first, then of the folders beside it."""
    for path in stage.inputs.values():
        makers = (_outs(folder, outs).get(os.path.realpath(path)) for folder in (spec.parent, *_beside(spec.parent)))
        maker = next(filter(None, makers), None)
        if maker is not None:
            yield maker
        elif not path.exists():
            what = f"{spec} needs it, and no spec there or in the folders beside it makes it"
            raise InputError(what, where=os.path.normpath(path), do="look at the path, or at that spec's first lines")


def _naming_maker(error: InputError, folder: Path, outs: dict[Path, dict[str, Path]]) -> InputError:
    """The error, which says what makes a missing file where that lies in the result of another spec."""
    above = [os.path.realpath(path) for path in Path(error.where or "").parents]
    known = (
        {} if Path(error.where or ".").exists() else {place: _outs(place, outs) for place in (folder, *_beside(folder))}
    )
    maker = next((by_out[path] for by_out in known.values() for path in above if path in by_out), None)
    if maker is None:
        return error
    return InputError(error.what, where=error.where, do=f"run cfem {KINDS[kind_of(maker)][2]} {maker} first")


def _beside(folder: Path) -> list[Path]:
    above = Path(os.path.relpath(os.path.dirname(os.path.abspath(folder))))
    return sorted(path for path in above.iterdir() if path.is_dir() and not path.name.startswith("."))


def _outs(folder: Path, known: dict[Path, dict[str, Path]]) -> dict[str, Path]:
    """Specs of a folder by where they put their results, a real path. Of two with the same `out`, the one without a
    suffix."""
    if folder not in known:
        spec_of = known[folder] = {}
        for spec in sorted(folder.glob("*.yaml"), key=lambda path: ("-" in path.stem, path.name)):
            if kind_of(spec) and spec.is_file():
                line = _OUT.search(spec.read_text(encoding="utf-8", errors="replace"))
                text = next(filter(None, line.groups()), None) if line else None
                spec_of.setdefault(os.path.realpath(folder / text), spec) if text else None
    return known[folder]
