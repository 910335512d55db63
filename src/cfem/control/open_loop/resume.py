"""What a run of `cfem control` in finite elements has done so far, kept beside its output: after an interruption the
same command goes on from there, to the same figures. Where the robot goes depends on the way that it has come
(predictions of the solver, friction), so the state of the plant is kept with the goals that it has finished."""

import io
import pickle  # nosec B403 - `_Reader` calls nothing but classes of values
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from enum import Enum
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from cfem.control.closed_loop.controller import Controller
from cfem.core.artefact.files import write_whole
from cfem.core.artefact.provenance import versions
from cfem.core.console.progress import say
from cfem.core.errors import CfemError
from cfem.plant.protocol import Changing

FILE = "so-far.pickle"
EVERY = 5.0  # s from one writing to the next at least,
DEARER = 20.0  # and so many times what the last one took
PLAIN = {
    "builtins": {"slice", "set", "frozenset"},
    "collections": {"deque"},
    "numpy": {"dtype", "ndarray"},
    "numpy._core.multiarray": {"_reconstruct", "scalar"},
    "numpy._core.numeric": {"_frombuffer"},
}


@dataclass
class Done:
    """Part of a run that is done, by trajectory.

    goals: number of goals that are finished
    rows: of these goals
    shapes: (s, 3) mm of the surface by goal
    solved: states whose commands are carried out once more on a finer mesh"""

    goals: dict[str, int] = field(default_factory=dict)
    rows: dict[str, list[dict]] = field(default_factory=dict)
    shapes: dict[str, dict[int, np.ndarray]] = field(default_factory=dict)
    solved: list[Any] = field(default_factory=list)

    def finished(self, name: str) -> int:
        """Number of goals of a trajectory that are finished."""
        return self.goals.get(name, 0)


class KeptRun:
    """Part of a run that is done, kept on the disk for the next run.

    goals: (m, n_e) mm by trajectory as an interrupted run has set them, None without one
    done: what it and this run have done"""

    def __init__(self, folder: Path, keep: bool = True):
        """folder: where the output is built; keep: whether what is done is worth keeping."""
        self._file, self._keep = folder / FILE, keep
        self._next, self._state = time.monotonic() + EVERY, b""
        self._changing: Changing = []
        self._fixed, self._known = [], {}
        self.goals: dict[str, np.ndarray] | None = None
        self.done = Done()
        if keep and self._file.exists():
            self._read()

    def begin(self, plants: Sequence[Any], goals: Mapping[str, np.ndarray]) -> None:
        """Registers the goals, and the plants whose states are kept, as they stand before the first goal."""
        if not self._keep:
            return
        self.goals, self._changing = dict(goals), [pair for plant in plants for pair in plant.changing]
        problems = [problem for plant in plants for problem in plant.problems]
        self._fixed = [fixed for problem in problems for fixed in (problem, problem.robot)]
        self._known = {id(fixed): number for number, fixed in enumerate(self._fixed)}
        if not self._state:
            self._write_when_due(None)
            return
        try:
            self.done = self._load()[0]
        except Exception as error:
            self._start_over(error)
            return
        count, total = sum(self.done.goals.values()), sum(map(len, goals.values()))
        say(f"control: going on after {count} of {total} goals, which an interrupted run has finished")

    def restore(self, judge: Controller | None = None) -> None:
        """Puts plant and judge, the controller whose model is the plant, where they stood after the last goal that an
        interrupted run has finished; once."""
        if not self._state:
            return
        _, plants, controller = self._load()
        self._state = b""
        _set(self._changing, plants)
        if judge and controller:
            _set(_judging(judge), controller)

    def finished(self, name: str, judge: Controller | None) -> None:
        """Counts one goal more of a trajectory: written to the disk now and then."""
        self.done.goals[name] = self.done.finished(name) + 1
        self._write_when_due(judge)

    def remove(self) -> None:
        """Removes what was kept, at the end of the run."""
        self._file.unlink(missing_ok=True)

    def _write_when_due(self, judge: Controller | None) -> None:
        """Writes what is done to the disk where enough time has passed; gives up where that fails."""
        begin = time.monotonic()
        if not self._keep or begin < self._next:
            return
        try:
            write_whole(self._file, self._bytes(judge))
        except (pickle.PicklingError, AttributeError, TypeError):
            self._give_up("the state of this plant cannot be kept")
        except (CfemError, MemoryError) as error:
            self._give_up(f"what is done cannot be kept ({error or 'out of memory'})")
        now = time.monotonic()
        self._next = now + max(EVERY, DEARER * (now - begin))

    def _bytes(self, judge: Controller | None) -> bytes:
        to = io.BytesIO()
        pickle.dump((versions(), self.goals), to, pickle.HIGHEST_PROTOCOL)
        state = self.done, _get(self._changing), _get(_judging(judge)) if judge else None
        _Writer(to, self._known).dump(state)
        data = to.getvalue()
        return sha256(data).digest() + data

    def _give_up(self, why: str) -> None:
        self._keep = False
        self._file.unlink(missing_ok=True)
        say(f"control: {why}: after an interruption this run starts over")

    def _read(self) -> None:
        """Reads what an interrupted run has kept; starts over where the file is damaged or of other versions."""
        stored = self._file.read_bytes()
        data = io.BytesIO(stored[32:])
        try:
            if sha256(stored[32:]).digest() != stored[:32]:
                raise pickle.UnpicklingError("it is damaged")
            by, goals = _Reader(data, []).load()
            if by != versions():
                raise pickle.UnpicklingError("other versions of cfem or of what it uses made it")
        except Exception as error:  # a file that others made may hold anything
            self._start_over(error)
            return
        self.goals, self._state = goals, data.read()

    def _load(self) -> tuple[Done, list, list | None]:
        return _Reader(io.BytesIO(self._state), self._fixed).load()

    def _start_over(self, error: Exception) -> None:
        self._state, self.done = b"", Done()
        say(f"control: {self._file}: what an interrupted run kept cannot be used ({error}): starting over")


class _Writer(pickle.Pickler):
    """known: numbers of objects that the reader has, by their id: a robot's matrices are found again."""

    def __init__(self, file: io.BytesIO, known: Mapping[int, int]):
        super().__init__(file, pickle.HIGHEST_PROTOCOL)
        self._known = known

    def persistent_id(self, obj: Any) -> int | None:
        return self._known.get(id(obj))


class _Reader(pickle.Unpickler):
    """Makes values: arrays, dataclasses, enumerations and tuples of cfem. What else a file asks for is refused."""

    def __init__(self, file: io.BytesIO, fixed: Sequence[Any]):
        super().__init__(file)
        self._fixed = fixed

    def persistent_load(self, pid: int) -> Any:
        return self._fixed[pid]

    def find_class(self, module: str, name: str) -> Any:
        if name in PLAIN.get(module, ()):
            return super().find_class(module, name)
        if module.startswith("cfem."):
            value = getattr(import_module(module), name, None)
            if isinstance(value, type) and (is_dataclass(value) or issubclass(value, Enum | tuple)):
                return value
        raise pickle.UnpicklingError(f"{module}.{name} is no value of cfem")


def _judging(judge: Controller) -> Changing:
    return [(judge, ("belief", "aimed", "_tick"))]


def _get(changing: Changing) -> list[dict[str, Any]]:
    return [{name: getattr(owner, name) for name in names} for owner, names in changing]


def _set(changing: Changing, values: Sequence[Mapping[str, Any]]) -> None:
    for (owner, _), attributes in zip(changing, values, strict=True):
        vars(owner).update(attributes)
