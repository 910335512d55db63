"""Sensors and actuators as they are: noise, a rate of their own, delay, coarse and limited commands, a robot that is
not the model's and is pushed."""

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np

from cfem.condensed import Condensed
from cfem.condensed.model import Model
from cfem.plant.marker_noise import MarkerNoise
from cfem.plant.protocol import Command, Measurement, Plant


@dataclass(frozen=True)
class Imperfection:
    """Faults of sensors and drives.

    noise: mm, standard deviation of each coordinate of a sample
    samples_a_tick: in (0, 1], sensor rate over control rate
    delay: ticks from sample to controller
    quantum: mm (mm^3) or N (MPa) that commands are rounded to, 0 for none
    low, high: commands beyond are cut off"""

    noise: float = 0.0
    samples_a_tick: float = 1.0
    delay: int = 0
    quantum: float = 0.0
    low: float = -np.inf
    high: float = np.inf


class ImperfectPlant:
    """Any plant behind imperfect sensors and actuators; the same for the same seed. Ticks are counted from 1 here,
    whatever the plant has done before; a measurement carries the tick at which it was taken (0: none has arrived yet).

    disturbed: takes the plant's place from tick `since` on; camera: sees markers and reads the actuators' sensors,
    which are perfect without it; actual: what the robot really did in the last tick."""

    def __init__(
        self,
        plant: Plant,
        imperfection: Imperfection,
        seed: int,
        disturbed: Plant | None = None,
        since: int = 0,
        camera: MarkerNoise | None = None,
    ):
        """Puts the faults of sensors and drives before `plant`, or from tick `since` on before `disturbed`; camera:
        shows markers."""
        self._plants, self._since, self._camera = (plant, disturbed), since, camera
        self._faults, self._random = imperfection, np.random.default_rng(seed)
        self._t = 0
        self._on_the_way: deque[tuple[int, Measurement]] = deque()
        self._arrived: Measurement | None = None
        self._last_command: tuple[Plant, Command, np.ndarray] | None = None
        self.actual: Measurement | None = None

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        """Last sample that has arrived after a command."""
        self._t += 1
        plant = self._plants[1] if self._plants[1] and self._t >= self._since else self._plants[0]
        command = self._applied(u)
        # A robot at rest that is told the same stays: no plant is asked twice, but for one that moves.
        last = None if getattr(plant, "moves", False) else self._last_command
        same = last is not None and last[:2] == (plant, kind) and np.array_equal(last[2], command)
        self.actual = replace(self.actual if same else plant.step(command, kind), t=self._t)
        self._last_command = (plant, kind, command)
        samples, before = (int(tick * self._faults.samples_a_tick + 1e-9) for tick in (self._t, self._t - 1))
        if samples > before:
            self._on_the_way.append((self._t + self._faults.delay, self._sample()))
        while self._on_the_way and self._on_the_way[0][0] <= self._t:
            self._arrived = self._on_the_way.popleft()[1]
        return self._arrived or self._nothing()

    def settle(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        """Lets a plant that moves stand still under u before the first tick."""
        return self._plants[0].settle(self._applied(u), kind)

    def _applied(self, u: np.ndarray) -> np.ndarray:
        """Command that the drives carry out: rounded to the quantum, cut off at the bounds."""
        u, quantum = np.asarray(u, float), self._faults.quantum
        return np.clip(quantum * np.round(u / quantum) if quantum > 0 else u, self._faults.low, self._faults.high)

    def _sample(self) -> Measurement:
        """Sample of the actual state, as the sensors give it."""
        x_e = self.actual.x_e
        sample = replace(self.actual, x_e=x_e + self._faults.noise * self._random.standard_normal(len(x_e)))
        return self._camera.seen(sample) if self._camera else sample

    def _nothing(self) -> Measurement:
        """Measurement before the first sample has arrived."""
        unknown = np.full_like(self.actual.x_e, np.nan)
        absent = None if self.actual.delta_a is None else np.full_like(self.actual.delta_a, np.nan)
        return Measurement(unknown, absent, absent, 0, "nothing measured yet")


@dataclass(frozen=True)
class Stiffer:
    """A robot of one material without loads, `factor` times as stiff as the model: W / factor, lambda * factor, the
    same delta (identity 6 of the condensed model)."""

    model: Model
    factor: float

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        state = self.model.at_displacement(delta_a)
        return replace(state, W=state.W / self.factor, lam=state.lam * self.factor)


@dataclass
class DriftingPlant:
    """A robot of one material without loads whose stiffness goes from 1 to `factor` times its first within `ticks`, in
    equal steps: the same displacements under forces of so many times the size (identity 6 of the condensed model)."""

    plant: Plant
    factor: float
    ticks: int
    _done: int = field(default=0, init=False)
    moves = True  # from step to step, whatever it is told

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        self._done += 1
        stiffness = 1.0 + (self.factor - 1.0) * min(self._done / self.ticks, 1.0)
        measurement = self.plant.step(np.asarray(u, float) / (stiffness if kind == "force" else 1.0), kind)
        lam = None if measurement.lambda_a is None else stiffness * measurement.lambda_a
        return replace(measurement, lambda_a=lam)
