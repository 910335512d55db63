"""Thin layers on faces of the body, as the user writes them: paper, fabric, windings of fibres."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from cfem.core.errors import InputError, SpecError
from cfem.core.spec import Spec
from cfem.core.units import Angle, Length, Stress
from cfem.mechanics.body import Body, with_layers
from cfem.mechanics.layer import Fabric, Fibres
from cfem.mechanics.mesh import Mesh
from cfem.robot.selection import Direction, Selection, select_faces


class FibresSpec(Spec):
    """A family of parallel fibres in a layer."""

    direction: Direction
    """Direction, x, y and z, which is projected onto each face."""
    angle: Angle = 0.0
    """Angle by which the fibres are then turned about the normal of the face: outward or, inside the body, along the
    axis across the flat box. Two families of opposite angles are a braid."""
    young: Annotated[Stress, Field(gt=0)]
    """Young's modulus along the fibres, as if they filled the layer."""


class LayerSpec(Spec):
    """A layer so thin that it resists stretching and not bending. Give `young`, fibres, or both: two families of fibres
    at right angles beside a softer `young` make an orthotropic fabric."""

    faces: Selection
    """Faces of the surface, chamber walls included, all of whose nodes lie in this region, or a named facet set. A box
    without thickness is a surface in the body too: meshes that cfem makes have faces on it, and the layer is there."""
    thickness: Length = Field(gt=0)
    """Thickness. Only its product with each modulus counts."""
    young: Annotated[Stress, Field(gt=0)] | None = None
    """Young's modulus in all directions of the face; none unless given."""
    poisson: float = Field(default=0.3, ge=0, le=0.5)
    """Poisson's ratio that goes with `young`."""
    fibres: list[FibresSpec] = []
    """Families of parallel fibres."""

    def check(self) -> None:
        if self.young is None and not self.fibres:
            raise ValueError("a layer needs young or fibres")

    @property
    def fabric(self) -> Fabric:
        """The layer as mechanics knows it."""
        families = tuple(Fibres(family.direction, family.angle, family.young) for family in self.fibres)
        return Fabric(self.thickness, self.young or 0.0, self.poisson, families)


def layered(layers: Sequence[LayerSpec], mesh: Mesh, body: Body) -> Body:
    """The body with the layers of a scene. SpecError where one selects no face, or its fibres lie in none."""
    chosen = [select_faces(mesh, item.faces, f"layers.{number}.faces") for number, item in enumerate(layers)]
    try:
        return with_layers(body, list(zip(chosen, (item.fabric for item in layers), strict=True)))
    except InputError as error:
        raise SpecError(error.what, where="layers", do=error.do) from None
