"""What the user writes in sample.yaml."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, WithJsonSchema, model_validator

from cfem.core.spec import Spec
from cfem.core.units import AngleRanges, Force, Length, LengthRanges


class SplitSpec(Spec):
    """One set of states. In `random` and `scrambled-halton` row i depends on the seed and on i alone, so that more rows
    extend a set; in `grid` (ends included; rows = k^(actuators + parameters)) and `latin-hypercube` it depends on their
    number too."""

    rows: int = Field(ge=1, le=10_000_000)
    method: Literal["scrambled-halton", "random", "grid", "latin-hypercube"]
    seed: int = Field(0, ge=0, lt=2**63)


def _two(given: Any) -> Any:
    numbers = next(iter(given.values())) if isinstance(given, dict) and len(given) == 1 else given
    if not isinstance(numbers, list) or len(numbers) != 2:
        raise ValueError("expected two values, such as [0.40, 0.49] or {kPa: [1000, 10000]}")
    return given


_PAIR = {"type": "array", "minItems": 2, "maxItems": 2}
_RANGE = {"anyOf": [_PAIR, {"type": "object", "minProperties": 1, "maxProperties": 1, "additionalProperties": _PAIR}]}


class ParameterSpec(Spec):
    """A number of the scene that differs from row to row. key: its path there, 'material.poisson' or
    'actuators.0.radius'. range: its smallest and largest value, as the scene would have them: [0.40, 0.49],
    ['1000 kPa', '10000 kPa'] or {kPa: [1000, 10000]}."""

    key: str = Field(min_length=1)
    range: Annotated[Any, AfterValidator(_two), WithJsonSchema(_RANGE)]

    @property
    def ends(self) -> tuple[str, str]:
        """Each as the scene would have it."""
        if isinstance(self.range, dict):
            ((unit, numbers),) = self.range.items()
            return tuple(f"{number} {unit}" for number in numbers)
        return tuple(str(number) for number in self.range)


class Until(Spec):
    """Sampling until a model knows the robot: the training split is then a pool, of which `first` rows are solved, and
    after them batches of `batch` rows where a spectral model of the states so far errs most, until its effectors were
    within `error` of FE at all rows of two batches in a row, before it had seen them, or `largest` rows are solved.
    form, max_terms: of that model, as in train.yaml."""

    error: Length = Field(gt=0)
    first: int = Field(20, ge=8)
    batch: int = Field(10, ge=1)
    largest: int = Field(1000, ge=8)
    form: Literal["displacement", "force"] = "displacement"
    max_terms: int = Field(1000, ge=1, le=10_000)


class ContactSpec(Spec):
    """All contact points of the scene as one rigid patch, about their mean, whose pose is drawn with the actuators'
    forces. translation: smallest and largest of x, y, z; rotation: of its rotation vector, left out where the patch
    cannot turn; force: largest of every actuator, from none on; about_rest: axes whose range is about where the patch
    would rest in them, were it free there, under the forces and the other coordinates that are drawn (to first order):
    for directions in which the robot is stiff, where a pose that does not yield to the cables would buckle it."""

    translation: LengthRanges
    rotation: AngleRanges | None = None
    force: Force = Field(gt=0)
    about_rest: list[Literal["x", "y", "z", "rx", "ry", "rz"]] = []

    @model_validator(mode="after")
    def _three_axes(self) -> "ContactSpec":
        for name, ranges in (("translation", self.translation), ("rotation", self.rotation)):
            if ranges is not None and (len(ranges) != 3 or not (ranges[:, 0] < ranges[:, 1]).all()):
                raise ValueError(f"{name}: expected three ranges, of x, y and z, the smaller number first")
        if self.rotation is None and any(axis.startswith("r") for axis in self.about_rest):
            raise ValueError("about_rest: the patch cannot turn, as rotation is left out")
        return self


class SampleSpec(Spec):
    """space: 'pulling' draws shares of a pull on all actuators (no actuator ever pushes); 'displacement' draws from the
    box of actuator displacements, 'force' from the box of the forces (pressures) that the scene's actuators state;
    'rest' leaves the actuators free, so that only the parameters differ: its designs are those of the other spaces, row
    by row.

    parameters: numbers of the scene, each by a name, that are drawn with the actuation. Young's modulus of a robot of
    one material without loads is not: W ~ 1/E and lambda ~ E are exact. third_order: also record dW/dlambda, which
    energy models learn from; it costs no factorisation.

    contact: instead of a space, draws the actuators' forces and the pose of the patch that holds the contact points.

    skeleton, shard: number of states solved first, from which all others start, and largest number of states in one
    unit of work. The dataset depends on both to rounding, and on the number of workers not at all."""

    scene: Path
    mesh: Path
    out: Path
    space: Literal["pulling", "displacement", "force", "rest"] = "pulling"
    splits: dict[Literal["train", "test"], SplitSpec] = Field(min_length=1)
    skeleton: int = Field(16, ge=1)
    shard: int = Field(50, ge=1)
    parameters: dict[Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")], ParameterSpec] = {}
    third_order: bool = False
    until: Until | None = None
    contact: ContactSpec | None = None
    tolerance: float = Field(1e-10, gt=0, le=1e-6, description="largest relative residual of a converged state")

    @model_validator(mode="after")
    def _keys_differ(self) -> "SampleSpec":
        keys = [one.key for one in self.parameters.values()]
        if len(set(keys)) < len(keys):
            raise ValueError(f"two parameters have the same key, of {keys}")
        return self

    @model_validator(mode="after")
    def _contact_alone(self) -> "SampleSpec":
        if self.contact and (self.parameters or self.until):
            raise ValueError("contact does not go with parameters or until yet")
        return self

    @model_validator(mode="after")
    def _space_alone(self) -> "SampleSpec":
        if self.space in ("force", "rest") and (self.contact or self.until):
            raise ValueError(f"space: {self.space} does not go with contact, which draws forces, nor with until yet")
        return self

    @model_validator(mode="after")
    def _splits_differ(self) -> "SampleSpec":
        drawn = [(split.method, split.seed) for split in self.splits.values() if split.method != "grid"]
        drawn += [(split.method, 0) for split in self.splits.values() if split.method == "grid"]
        if len(set(drawn)) < len(drawn):
            raise ValueError("train and test share method and seed, hence rows; give them different seeds")
        return self
