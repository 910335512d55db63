"""Spec of sample.yaml."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, WithJsonSchema

from cfem.core.actuator_units import Effort
from cfem.core.spec import Spec
from cfem.core.units import AngleRanges, Length, LengthRanges
from cfem.robot.mesh.error_spec import MeshErrorSpec

SEQUENCES = ("random", "scrambled-halton")  # methods whose row i depends on the seed and on i alone


class SplitSpec(Spec):
    """One set of states. With `random` and `scrambled-halton` row i depends on the seed and on i alone: with more rows,
    `cfem sample` keeps the states that are there and adds the others. With `grid` and `latin-hypercube` all rows depend
    on their number too."""

    rows: int = Field(ge=1, le=10_000_000)
    """Number of states. For a grid: k^(actuators + parameters)."""
    method: Literal["scrambled-halton", "random", "grid", "latin-hypercube"]
    """How the states are drawn. A grid includes the ends."""
    seed: int = Field(0, ge=0, lt=2**63)
    """Seed of the random numbers. Train and test need different seeds."""


def _two(given: Any) -> Any:
    numbers = next(iter(given.values())) if isinstance(given, dict) and len(given) == 1 else given
    if not isinstance(numbers, list) or len(numbers) != 2:
        raise ValueError("expected two values, such as [0.40, 0.49] or {kPa: [1000, 10000]}")
    return given


_PAIR = {"type": "array", "minItems": 2, "maxItems": 2}
_RANGE = {"anyOf": [_PAIR, {"type": "object", "minProperties": 1, "maxProperties": 1, "additionalProperties": _PAIR}]}


class ParameterSpec(Spec):
    """A number of the scene that differs from row to row."""

    key: str = Field(min_length=1)
    """Its path in the scene: 'material.poisson' or 'actuators.0.radius'."""
    range: Annotated[Any, AfterValidator(_two), WithJsonSchema(_RANGE)]
    """Smallest and largest value: [0.40, 0.49], ['1000 kPa', '10000 kPa'] or {kPa: [1000, 10000]}."""

    @property
    def ends(self) -> tuple[str, str]:
        """Ends of the range, each as the scene would have it."""
        if isinstance(self.range, dict):
            ((unit, numbers),) = self.range.items()
            return tuple(f"{number} {unit}" for number in numbers)
        return tuple(str(number) for number in self.range)


class Until(Spec):
    """Sampling until a model knows the robot. The training split is a pool. Its first rows are solved, then batches
    where a spectral model of the states so far is worst. It ends when, in two batches in a row, the effectors of all
    new rows were predicted within `error` of FE, or at `largest` rows."""

    error: Length = Field(gt=0)
    """Largest distance of the predicted effectors from FE."""
    first: int = Field(20, ge=8)
    """Rows solved first."""
    batch: int = Field(10, ge=1)
    """Rows per batch."""
    largest: int = Field(1000, ge=8)
    """Largest number of rows."""
    form: Literal["displacement", "force"] = "displacement"
    """What the model is a function of, as in train.yaml."""
    max_terms: int = Field(1000, ge=1, le=10_000)
    """Largest number of terms of one series, as in train.yaml."""


class AroundSpec(Spec):
    """States where a task goes, added to a dataset that is there."""

    task: Path
    """Folder of a run of `cfem control`."""
    base: Path | None = None
    """Folder of the dataset to which they are added. That of `out` unless given; the result is then beside it, with
    `-around` behind its name."""
    add: int = Field(20, ge=1)
    """Number of states."""
    judges: int = Field(8, ge=0)
    """Number of other states of the task that go to the test split, to judge the model there."""


class HeldPatchSpec(Spec):
    """All contact points of the scene as one rigid patch, about their mean. Its pose is drawn with the actuators'
    forces."""

    translation: LengthRanges
    """Smallest and largest displacement of the patch along x, y and z."""
    rotation: AngleRanges | None = None
    """Smallest and largest rotation vector, x, y and z. Left out where the patch cannot turn."""
    force: Effort = Field(gt=0)
    """Largest force of every actuator. The smallest is 0."""
    about_rest: list[Literal["x", "y", "z", "rx", "ry", "rz"]] = []
    """Axes whose range is about where the patch would rest if it were free there (to first order). For directions in
    which the robot is stiff, where a pose that does not yield to the cables would buckle it."""

    def check(self) -> None:
        for name, ranges in (("translation", self.translation), ("rotation", self.rotation)):
            if ranges is not None and (len(ranges) != 3 or not (ranges[:, 0] < ranges[:, 1]).all()):
                raise ValueError(f"{name}: expected three ranges, of x, y and z, the smaller number first")
        if self.rotation is None and any(axis.startswith("r") for axis in self.about_rest):
            raise ValueError("about_rest: the patch cannot turn, as rotation is left out")


class SkinSpec(Spec):
    """Modes of the surface, from which the whole shape follows. Each is a row of W beside the effectors."""

    tolerance: Length | None = Field(None, gt=0)
    """Largest distance of a surface node from where the modes put it, in skeleton states that had no part in them.
    0.02 % of the robot's length unless given."""
    modes: int | None = Field(None, ge=1, le=100)
    """Number of modes, instead of a tolerance."""
    largest: int = Field(40, ge=1, le=100)
    """Largest number of modes that a tolerance may take."""
    inner: bool = False
    """Whether the modes reach the nodes inside as well, for stress and volumes."""

    def check(self) -> None:
        if self.modes is not None and self.tolerance is not None:
            raise ValueError("modes: the tolerance decides their number; leave one of them out")


class SampleSpec(Spec):
    """Which equilibria `cfem sample` solves, and where it stores them. Young's modulus of a robot of one material,
    without layers and loads, need not vary: W ~ 1/E and lambda ~ E are exact."""

    scene: Path
    """The robot's scene.yaml."""
    mesh: Path
    """Folder of its mesh."""
    out: Path
    """Folder for the dataset."""
    space: Literal["pulling", "displacement", "force", "rest"] = "pulling"
    """pulling: shares of a pull on all actuators, so that none pushes. displacement: the box of actuator displacements.
    force: the box of forces or pressures that the actuators state. rest: actuators free, so that only parameters
    differ."""
    slack: bool = True
    """Whether cables let go rather than push. False: they push in samples, over the whole box of `space: displacement`.
    For robots that something outside bends to where a cable that pulls there would push in the air, such as legs."""
    idle: float = Field(0.0, ge=0, lt=1)
    """Share of the rows of `space: pulling` in which an actuator is left without force. Where there are more cables
    than coordinates of a goal, control pulls no more of them than it needs: it leaves the inside of the cube of
    pulls."""
    splits: dict[Literal["train", "test"], SplitSpec] = Field(min_length=1)
    """The sets of states: train and test."""
    skeleton: int = Field(16, ge=1)
    """Number of states solved first. All others start from them."""
    shard: int = Field(50, ge=1)
    """Largest number of states in one unit of work."""
    parameters: dict[Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")], ParameterSpec] = {}
    """Numbers of the scene, by a name, that are drawn with the actuation."""
    third_order: bool = False
    """Whether to record dW/dlambda too. Energy models learn from it; it costs no factorisation."""
    loads: bool | Literal[2] = False
    """Whether to record how the effectors' compliance changes with loads on them too. Models then take loads that the
    samples did not carry to the second order, and effectors of solids that move swing on arcs. It costs no
    factorisation. 2: its second derivative as well, for modules in a row under large loads. A state then takes ten
    times as long, or longer."""
    dynamics: bool = False
    """Whether to record mass and viscosity of the rows' motions too, for models that move. It costs no factorisation.
    Each material of the scene then needs its density."""
    frequencies: bool = False
    """True: compute the natural frequencies of finite elements at the test states, so that models state how far
    theirs are off. Each test state is solved once more."""
    skin: SkinSpec | None = SkinSpec()
    """Modes of the surface, for shapes without finite elements. Null leaves them out."""
    until: Until | None = None
    """Sample until a stated error instead of a stated number of rows."""
    around: AroundSpec | None = None
    """Add states where a task goes to a dataset that is there, instead of sampling it."""
    contact: HeldPatchSpec | None = None
    """Draw the actuators' forces and the pose of the patch that holds the contact points, instead of a space."""
    mesh_error: MeshErrorSpec | None = None
    """How the error of the mesh is estimated over the range of the training states, for models to state. Each of its
    states takes about two factorisations on a mesh of eight times as many cells."""
    tolerance: float = Field(1e-10, gt=0, le=1e-6)
    """Largest relative residual of a converged state."""

    def check(self) -> None:
        """Checks that the fields go together."""
        keys = [parameter.key for parameter in self.parameters.values()]
        if len(set(keys)) < len(keys):
            raise ValueError(f"two parameters have the same key: {keys}")
        if self.loads and self.contact:
            raise ValueError("loads does not go with contact")
        if not self.slack and (self.space != "displacement" or self.contact):
            raise ValueError("slack: false needs space: displacement, and does not go with contact")
        if self.idle and (self.space != "pulling" or self.contact):
            raise ValueError("idle needs space: pulling, and does not go with contact")
        if self.mesh_error and (self.contact or self.space == "rest"):
            raise ValueError("mesh_error does not go with contact or space: rest yet")
        if self.contact and (self.parameters or self.until):
            raise ValueError("contact does not go with parameters or until yet")
        if self.frequencies and not (self.dynamics and "test" in self.splits and not self.parameters):
            raise ValueError("frequencies needs dynamics and test states, and does not go with parameters")
        if self.dynamics and self.contact:
            raise ValueError("dynamics does not go with contact yet")
        if self.space in ("force", "rest") and (self.contact or self.until):
            raise ValueError(f"space: {self.space} does not go with contact, which draws forces, nor with until yet")
        if self.around and (self.contact or self.until or self.space == "rest"):
            raise ValueError("around does not go with contact, until or space: rest")
        drawn = [(split.method, split.seed) for split in self.splits.values() if split.method != "grid"]
        drawn += [(split.method, 0) for split in self.splits.values() if split.method == "grid"]
        if len(set(drawn)) < len(drawn):
            raise ValueError(
                "train and test have the same method and seed, so they would share rows; give them different seeds"
            )
