"""Contact of a body's surface with itself, as the user writes it."""

from dataclasses import replace
from typing import Annotated

from pydantic import BeforeValidator, Field

from cfem.constraint.surface import triangulated
from cfem.contact.surface.facing import facing
from cfem.contact.surface.overlap import boundary_of
from cfem.core.errors import SpecError
from cfem.core.spec import Spec
from cfem.core.units import Length, Percent
from cfem.mechanics.body import Body
from cfem.mechanics.self_contact import POINTS, make_self_contact

WITHIN = 0.05  # of the robot's length
OVERLAP = 1e-3  # of the robot's length: what may be rounding of the shape at rest


class SelfContactSpec(Spec):
    """Walls that face each other across a gap, chamber walls included, push each other once it has closed, without
    friction. Each place keeps the partner that it has at rest."""

    within: Length | None = Field(default=None, gt=0)
    """Widest gap, straight out of a wall, across which it has a partner: 5 % of the robot's length unless given."""
    onset: Percent = 0.1
    """Share of the gap at rest at which walls begin to push. They touch at a pressure of a tenth of Young's modulus."""


def _as_spec(given: object) -> object:
    """The spec that a user's value stands for: all defaults of `true`, no spec of `false`."""
    return ({} if given else None) if isinstance(given, bool) else given


OptionalSelfContact = Annotated[SelfContactSpec | bool | None, BeforeValidator(_as_spec)]  # bool for editors alone


def touching_itself(spec: SelfContactSpec | None, body: Body, length: float) -> Body:
    """The body, of a robot of `length` mm, with the self-contact of its scene. SpecError where no walls face each
    other, or parts of the body overlap at rest."""
    if spec is None:
        return body
    X, facets = body.mesh.X, body.mesh.facets
    within = spec.within or WITHIN * length
    pairs = facing(X, facets[:, :3], POINTS, within)
    at_rest = boundary_of(X, triangulated(facets)).at_rest
    if at_rest > OVERLAP * length:
        what = f"parts of the body pass through each other by {at_rest:.3g} mm at rest"
        raise SpecError(what, where="self_contact", do="take them apart in the program that made the shape")
    if not len(pairs[0]):
        what = f"no walls of the body face each other within {within:.3g} mm"
        raise SpecError(what, where="self_contact", do="leave it out, or give a larger `within`")
    return replace(body, contact=make_self_contact(X, facets, pairs, spec.onset, body.shear))
