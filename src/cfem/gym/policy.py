"""A trained policy as a file: ONNX, from observation to action, and what it must know of the robot in its metadata."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.condensed.parameters import from_json, shares
from cfem.core.errors import InputError
from cfem.core.optional import demand
from cfem.core.reading import demand_file
from cfem.gym.moving_tasks import moving_observation
from cfem.gym.tasks import Scales, observation

KEY = "cfem.policy"
FORMAT = 3


@dataclass(frozen=True)
class PolicyNetwork:
    """A policy from a file of `cfem.gym.save_policy.save_network`, of any environment. InputError where it is none.

    facts: its metadata; inputs: numbers of an observation"""

    path: Path

    def __post_init__(self) -> None:
        """Reads the network and the facts beside it."""
        demand("onnxruntime", where="policy")
        import onnxruntime

        demand_file(Path(self.path), "train a policy first")
        try:
            session = onnxruntime.InferenceSession(str(self.path), providers=["CPUExecutionProvider"])
            facts = json.loads(session.get_modelmeta().custom_metadata_map[KEY])
            if facts["format"] != FORMAT:
                raise ValueError("it is of another format, train it again")
        except Exception as error:  # of onnxruntime, which share no class, of JSON, of the keys
            raise _no_policy(self.path, error) from None
        object.__setattr__(self, "facts", facts)
        object.__setattr__(self, "inputs", session.get_inputs()[0].shape[1])
        object.__setattr__(self, "_session", session)

    def actions(self, seen: np.ndarray) -> np.ndarray:
        """Actions (B, n_a) after observations (B, n), float32 both."""
        return self._session.run(None, {self._session.get_inputs()[0].name: seen})[0]


def _no_policy(path: Path, error: Exception) -> InputError:
    what = f"is no policy of cfem: {str(error).splitlines()[0][:200]}"
    return InputError(what, where=str(path), do="write it by cfem.gym.save_policy.save_policy")


@dataclass(frozen=True)
class Policy:
    """A policy from a file of `cfem.gym.save_policy`. facts: its metadata; parameters: those of the robot that it wants
    to be told, none of most policies; moving: `ahead`, `history` and `tick` of `cfem.gym.moving_world`, nothing for
    robots at rest. InputError where the file is no policy."""

    path: Path

    def __post_init__(self) -> None:
        """Reads the network and the facts beside it. InputError where the file is no policy of cfem."""
        network = PolicyNetwork(self.path)
        facts = network.facts
        try:
            sizes = [len(facts[name]) for name in ("step", "low", "reach")]
            parameters, moving = from_json(facts["parameters"]), facts["moving"]
        except Exception as error:  # of the keys
            raise _no_policy(self.path, error) from None
        n_a, n_e = len(facts["actuators"]), len(facts["effectors"])
        observed = 4 * n_e + n_a + len(parameters)
        if moving:
            observed = n_e * (1 + moving["ahead"] + moving["history"]) + n_a * moving["history"]
        if sizes != [n_a] * 3 or network.inputs != observed:
            what = f"does not take the {observed} numbers of an observation of its robot"
            raise InputError(what, where=str(self.path), do="train it again")
        object.__setattr__(self, "parameters", parameters)
        object.__setattr__(self, "moving", moving)
        object.__setattr__(self, "facts", facts)
        object.__setattr__(self, "_network", network)
        numbers = (np.asarray(facts[name], float) for name in ("step", "low", "reach"))
        object.__setattr__(self, "scales", Scales(float(facts["scale"]), float(facts["near"]), *numbers))

    def demand_robot(self, effectors: Sequence[str], actuators: Sequence[str]) -> None:
        """Raises InputError where it is a policy of other rows."""
        if (list(effectors), list(actuators)) != (self.facts["effectors"], self.facts["actuators"]):
            robot_rows = f"{', '.join(self.facts['effectors'])} by {', '.join(self.facts['actuators'])}"
            raise InputError(
                f"is a policy of another robot: of {robot_rows}", where=str(self.path), do="train one of this robot"
            )

    def told(self, p: np.ndarray) -> np.ndarray:
        """Part (..., k) of an observation: parameters p (..., n_p) of the robot, as shares of their ranges in [-1,
        1]."""
        return 2.0 * shares(self.parameters, p) - 1.0

    def command(
        self, tip: np.ndarray, u: np.ndarray, goal: np.ndarray, ahead: np.ndarray, parameters: np.ndarray
    ) -> np.ndarray:
        """Command (n_a,) mm that follows u (n_a,), the effector at tip (n_e,) and the goal at goal, mm from rest, which
        goes on by ahead (n_e,) mm in the next tick; parameters: of its robot, as `told` scales them."""
        return self.commands(*(np.asarray(array, float)[None] for array in (tip, u, goal, ahead, parameters)))[0]

    def commands(
        self, tip: np.ndarray, u: np.ndarray, goal: np.ndarray, ahead: np.ndarray, parameters: np.ndarray
    ) -> np.ndarray:
        """Commands (B, n_a) mm: as `command`, of many robots."""
        return self._next(u, observation(self.scales, tip, u, goal, ahead, parameters))

    def moving_command(self, tips: np.ndarray, us: np.ndarray, goals: np.ndarray) -> np.ndarray:
        """Next command (n_a,) mm or N after us (history, n_a) and samples tips (history, n_e) mm from rest, newest
        first, to goals (k, n_e), of the end of this tick first, of which the last is taken to stay."""
        goals = np.concatenate([goals, np.repeat(goals[-1:], self.moving["ahead"], axis=0)])[: self.moving["ahead"]]
        return self._next(us[:1], moving_observation(self.scales, tips[None], us[None], goals[None]))[0]

    def _next(self, u: np.ndarray, seen: np.ndarray) -> np.ndarray:
        return self.scales.command(u, self._network.actions(seen))
