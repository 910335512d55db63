"""Names and order of the rows of W: effectors, then actuators, then contacts."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Rows:
    """One name a scalar row, e.g. effectors ('tip.x', 'tip.y', 'tip.z'), actuators ('left', 'right')."""

    effectors: tuple[str, ...]
    actuators: tuple[str, ...]
    contacts: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        return self.effectors + self.actuators + self.contacts

    @property
    def n_e(self) -> int:
        return len(self.effectors)

    @property
    def n_a(self) -> int:
        return len(self.actuators)

    @property
    def n_c(self) -> int:
        return len(self.contacts)

    @property
    def n(self) -> int:
        return len(self.names)

    @property
    def e(self) -> slice:
        return slice(0, self.n_e)

    @property
    def a(self) -> slice:
        return slice(self.n_e, self.n_e + self.n_a)

    @property
    def c(self) -> slice:
        return slice(self.n_e + self.n_a, self.n)

    @property
    def active(self) -> slice:
        """Rows that carry a multiplier: actuators and contacts."""
        return slice(self.n_e, self.n)
