"""What plants in contact tell of their steps."""

from collections import Counter
from collections.abc import Iterable

from cfem.contact.modes import Mode


class ContactAccount:
    """counts: how many contact points were open, stuck and slipped at the end of each command so far; commands;
    failures: of them ended before their goal; steps, iterations: quasi-static steps, rounds of FE solves that they
    took; worst: relative residual of law and balance at the end of a command."""

    def __init__(self) -> None:
        self.counts: list[dict[str, int]] = []
        self.commands = self.steps = self.iterations = self.failures = 0
        self.worst = 0.0

    COUNTED = ("counts", "commands", "failures", "steps", "iterations", "worst")

    def seen(self, modes: Iterable[Mode], residual: float) -> None:
        """The state in which a command ended."""
        self.counts.append(dict(Counter(mode.value for mode in modes)))
        self.worst = max(self.worst, residual)

    def account(self) -> dict:
        """For a results file."""
        total = {mode: sum(one.get(mode, 0) for one in self.counts) for mode in ("open", "stick", "slip")}
        return {
            "commands": self.commands,
            "failures": self.failures,
            "points": total,
            "steps": self.steps,
            "iterations": self.iterations,
            "law_residual": self.worst,
        }

    def sentence(self) -> str:
        """For people."""
        points = ", ".join(f"{count} {mode}" for mode, count in self.account()["points"].items())
        return (
            f"contact: {self.commands - self.failures} of {self.commands} commands carried out; contact points at "
            f"their ends: {points}; {self.steps} quasi-static steps, {self.iterations} rounds of FE; the law is met to "
            f"{self.worst:.1e}"
        )
