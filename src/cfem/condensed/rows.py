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
    def effector_units(self) -> tuple[tuple[str, str], ...]:
        """Of each effector row's displacement and of the force that works on it; rows end in x, y, z, rx, ry or rz."""
        turns = [name.rpartition(".")[2].startswith("r") for name in self.effectors]
        return tuple(("rad", "N mm") if turn else ("mm", "N") for turn in turns)

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

    def difference(self, other: "Rows", whose: str) -> str:
        """In words, of another robot's rows: 'drives left and right, the scene cable'."""
        kinds = (
            ("drives", self.actuators, other.actuators),
            ("watches", self.effectors, other.effectors),
            ("may be touched at", self.contacts, other.contacts),
        )
        said = [f"{verb} {_listed(mine)}, {whose} {_listed(theirs)}" for verb, mine, theirs in kinds if mine != theirs]
        return "; it ".join(said)


def _listed(names: tuple[str, ...]) -> str:
    *others, last = names or ("nothing",)
    return f"{', '.join(others)} and {last}" if others else last
