"""Names and order of the rows of W: effectors, then the skin, then actuators, then contacts."""

from dataclasses import dataclass
from functools import cached_property


@dataclass(frozen=True)
class Rows:
    """Names of the scalar rows, e.g. effectors ('tip.x', 'tip.y', 'tip.z'), actuators ('left', 'right').

    skin: modes of the surface (`cfem.condensed.skin`), which only those have who ask for the shape; goals and errors
    are the effectors' alone."""

    effectors: tuple[str, ...]
    actuators: tuple[str, ...]
    contacts: tuple[str, ...] = ()
    skin: tuple[str, ...] = ()

    @cached_property
    def names(self) -> tuple[str, ...]:
        return self.effectors + self.skin + self.actuators + self.contacts

    @property
    def effector_units(self) -> tuple[tuple[str, str], ...]:
        """Units (displacement, force that works on it) of each effector row; rows end in x, y, z, rx, ry or rz."""
        return tuple(("rad", "N mm") if turns else ("mm", "N") for turns in self.turns)

    @property
    def turns(self) -> tuple[bool, ...]:
        """True for each effector row that is of a rotation vector."""
        return tuple(name.rpartition(".")[2].startswith("r") for name in self.effectors)

    @cached_property
    def n_e(self) -> int:
        return len(self.effectors)

    @cached_property
    def n_s(self) -> int:
        return len(self.skin)

    @cached_property
    def n_a(self) -> int:
        return len(self.actuators)

    @cached_property
    def n_c(self) -> int:
        return len(self.contacts)

    @cached_property
    def n(self) -> int:
        return len(self.names)

    @cached_property
    def e(self) -> slice:
        return slice(0, self.n_e)

    @cached_property
    def s(self) -> slice:
        return slice(self.n_e, self.n_e + self.n_s)

    @cached_property
    def watched(self) -> slice:
        """Rows that carry no multiplier: effectors and skin."""
        return slice(0, self.n_e + self.n_s)

    @cached_property
    def a(self) -> slice:
        return slice(self.watched.stop, self.watched.stop + self.n_a)

    @cached_property
    def c(self) -> slice:
        return slice(self.a.stop, self.n)

    @cached_property
    def active(self) -> slice:
        """Rows that carry a multiplier: actuators and contacts."""
        return slice(self.watched.stop, self.n)

    def difference(self, other_rows: "Rows", whose: str) -> str:
        """Difference from another robot's rows in words: 'drives left and right, the scene cable'."""
        kinds = (
            ("drives", self.actuators, other_rows.actuators),
            ("watches", self.effectors, other_rows.effectors),
            ("may be touched at", self.contacts, other_rows.contacts),
        )
        phrases = [
            f"{verb} {_listed(my_names)}, {whose} {_listed(their_names)}"
            for verb, my_names, their_names in kinds
            if my_names != their_names
        ]
        return "; it ".join(phrases)


def _listed(names: tuple[str, ...]) -> str:
    *others, last = names or ("nothing",)
    return f"{', '.join(others)} and {last}" if others else last
