"""Statistics that plants in contact keep of their steps."""

from collections import Counter
from collections.abc import Iterable
from typing import Any

from cfem.contact.clearance import TOLERANCE
from cfem.contact.law.modes import Mode
from cfem.core.artefact.judgement import poor

DEEP = 0.01  # of the length: how far the surface may be in an obstacle between its patches


class ContactAccount:
    """Statistics of contact over all commands so far.

    counts: how many contact points were open, stuck and slipped at the end of each command
    commands, failures: how many, and how many of them ended before their goal
    steps, iterations: quasi-static steps, and rounds of FE solves that they took
    worst: relative residual of law and balance at the end of a command
    deepest: how far (mm) the surface was in which obstacle, other robot or the robot itself then, between the patches,
        which alone touch
    unjudged: other robots whose surface overlapped itself at the end of a command, so that nothing says how deep in"""

    def __init__(self, parts: str = "patches", finer: str = "take a smaller contact.patches") -> None:
        """Begins an account. parts: what alone touches; finer: how there would be more of them."""
        self._parts, self._finer = parts, finer
        self.counts: list[dict[str, int]] = []
        self.commands = self.steps = self.iterations = self.failures = 0
        self.worst, self.deepest = 0.0, (0.0, "")
        self.unjudged: frozenset[str] = frozenset()

    COUNTED = ("counts", "commands", "failures", "steps", "iterations", "worst", "deepest", "unjudged")

    def seen(self, modes: Iterable[Mode], residual: float) -> None:
        """The state in which a command ended."""
        self.counts.append(dict(Counter(mode.value for mode in modes)))
        self.worst = max(self.worst, residual)

    def account(self) -> dict:
        """Account of contact for a results file."""
        total = {mode: sum(modes.get(mode, 0) for modes in self.counts) for mode in ("open", "stick", "slip")}
        return {
            "commands": self.commands,
            "failures": self.failures,
            "points": total,
            "steps": self.steps,
            "iterations": self.iterations,
            "law_residual": self.worst,
            "deepest": self.deepest[0],
        }

    def judged(self, length: float) -> list[dict[str, Any]]:
        """Findings about a robot of this length (mm): POOR where its patches, which alone touch, let the surface
        through, or where nobody can say."""
        depth, name = self.deepest
        findings = [
            poor(f"the surface of {other} overlaps itself: how far this robot reaches into it is not known")
            for other in sorted(self.unjudged)
        ]
        if depth > DEEP * length:
            findings.append(
                poor(f"the surface reaches {depth:.2g} mm into {name} between its {self._parts}: {self._finer}")
            )
        return findings

    def sentence(self) -> str:
        """Sentence about contact for people."""
        points = ", ".join(f"{count} {mode}" for mode, count in self.account()["points"].items())
        return (
            f"contact: {self.commands - self.failures} of {self.commands} commands carried out; contact points at "
            f"their ends: {points}; {self.steps} quasi-static steps, {self.iterations} rounds of FE; the law is met to "
            f"{self.worst:.1e}{self._between()}"
        )

    def _between(self) -> str:
        depth, name = self.deepest
        return (
            f"; between {self._parts} the surface reaches up to {depth:.2g} mm into {name}" if depth > TOLERANCE else ""
        )
