"""Schema of model.json, checked before a model is built from it; see surrogate/model_card.py, which writes it."""

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator

from cfem.condensed.card import MOST, Pair, ParameterCard, RowsCard, Units
from cfem.condensed.mesh_error import MeshError
from cfem.condensed.model import Form
from cfem.condensed.model_error import ModelError
from cfem.core.names import Name
from cfem.core.reading import Data
from cfem.predict.array_predictor import KINDS

FORMAT = 3


class DomainCard(Data):
    """See `cfem.predict.series.domain.Domain`."""

    delta_a: tuple[list[float], list[float]]
    lambda_a: tuple[list[float], list[float]]
    p: tuple[list[float], list[float]]
    states: list[list[float]] = Field(min_length=1, max_length=10_000)


class PlaceCard(Data):
    """One module of a row: which of the models it is, and its compliance relative to that."""

    model: int = Field(ge=0)
    softer: float = Field(gt=0)


class PatchLoadCard(Data):
    """See `cfem.constraint.patch.PatchLoad`."""

    at: tuple[float, float, float]
    radius: float = Field(gt=0)
    force: tuple[float, float, float]
    name: str


class DatasetSummary(Data):
    """The data that the model was trained on."""

    content: str = ""
    samples: int = Field(0, ge=0)


ABSENT = {"errors": {}, "history": [], "versions": {}, "dataset": {}}


class ModelCard(Data):
    """Content of model.json.

    robot: what the scene said of it
    wrench: constant load that the samples did not carry, on each effector row
    patch_loads: others, on patches of the surface
    wrench_error: estimated error that these loads make, mm
    mesh_error: of the mesh that the samples were solved on, see `cfem.condensed.mesh_error`
    model_error: of the model beside that mesh, see `cfem.condensed.model_error`
    untrained_rest: whether the domain holds the state at rest, in which no sample was
    semidefinite: of each effector row, see `cfem.predict.series.semidefinite`
    masses: t, by the name of the effector that is their centre
    modules, row: of modules in a row
    motion: of mass and viscosity, see `cfem.motion`
    activation, at_rest: of a network of entries"""

    format: Literal[FORMAT]
    kind: str
    form: Form
    scene: Name
    robot: dict[str, Any] | None = None
    rows: RowsCard
    n_c: int = Field(ge=0)
    row_units: list[Units]
    units: dict[str, Any]
    rest_e: list[float]
    reach: list[Pair]
    length: float = Field(gt=0)
    parameters: list[ParameterCard] = Field(max_length=MOST)
    domain: DomainCard
    semidefinite: list[Annotated[float, Field(gt=0)]] | None = None
    wrench: list[float] | None = None
    patch_loads: list[PatchLoadCard] | None = None
    wrench_error: float | None = None
    mesh_error: MeshError | None = None
    model_error: ModelError | None = None
    untrained_rest: bool = False
    errors: dict[str, Any] = {}
    history: list[Any] = []
    versions: dict[str, str] = {}
    dataset: DatasetSummary = DatasetSummary()
    motion: dict[str, Any] | None = None
    activation: Literal["relu", "tanh", "silu"] | None = None
    masses: dict[str, Annotated[float, Field(gt=0)]] = {}
    row: list[PlaceCard] | None = Field(None, min_length=1, max_length=100)
    modules: "list[ModelCard] | None" = Field(None, min_length=1, max_length=100)
    at_rest: "ModelCard | None" = None

    @property
    def learned(self) -> list[tuple[str, str]]:
        """Keys and coordinates of the parameters that are inputs."""
        return [(parameter.key, parameter.coordinate) for parameter in self.parameters if not parameter.exact]

    def check(self) -> None:
        """ValueError where sizes do not agree with each other, or keys do not go with the kind."""
        n_e, n_a = len(self.rows.effectors), len(self.rows.actuators)
        n_q = len(self.learned)
        domain = self.domain
        for what, lengths, expected in (
            ("n_c", [self.n_c], {min(self.n_c, n_a - 1)}),
            ("row_units", [len(self.row_units)], {n_e + n_a}),
            ("rest_e", [len(self.rest_e)], {n_e}),
            ("semidefinite", [n_e if self.semidefinite is None else len(self.semidefinite)], {n_e}),
            ("wrench", [n_e if self.wrench is None else len(self.wrench)], {n_e}),
            ("reach", [len(self.reach)], {n_a, n_a - self.n_c}),
            ("domain.delta_a", map(len, domain.delta_a), {n_a}),
            ("domain.lambda_a", map(len, domain.lambda_a), {n_a}),
            ("domain.p", map(len, domain.p), {n_q}),
            ("domain.states", map(len, domain.states), {2 * n_a + n_q}),
        ):
            if not set(lengths) <= expected:
                raise ValueError(f"{what} does not have the numbers that the rows ask for")
        if any(not low < high for low, high in self.reach):
            raise ValueError("reach: the smaller number comes first")
        if self.rows.contacts:
            raise ValueError("rows: the pose of a held patch belongs to the actuators")
        if (self.kind == "mlp") != (self.activation is not None):
            raise ValueError("activation belongs to kind mlp")
        rest = self.at_rest
        if rest is not None and (self.kind != "mlp" or rest.rows != self.rows or rest.learned != self.learned):
            raise ValueError("at_rest belongs to kind mlp, with the same rows and parameters")
        serial = self.kind == "serial"
        if serial != (self.row is not None) or serial != (self.modules is not None):
            raise ValueError("row and modules belong to kind serial")
        if serial:
            self._demand_modules()

    @field_validator("kind")
    @classmethod
    def _known(cls, kind: str) -> str:
        if kind not in KINDS:
            raise ValueError(f"expected one of {', '.join(KINDS)}")
        return kind

    def _demand_modules(self) -> None:
        """ValueError where the modules of a row do not make up the robot."""
        if any(place.model >= len(self.modules) for place in self.row):
            raise ValueError("row: names a model that is not there")
        ends, used = len(self.rows.effectors), [self.modules[place.model] for place in self.row]
        heavy = [len(card.rows.effectors) == 9 and len(card.masses) == 1 for card in used]
        sizes = {len(card.rows.effectors) for card in used} <= {6, 9} and (ends == 3 or (ends == 6 and all(heavy)))
        actuators = sum(len(card.rows.actuators) for card in used)
        if (
            not sizes
            or actuators != len(self.rows.actuators)
            or self.parameters
            or any(card.parameters for card in used)
        ):
            raise ValueError("its modules do not make up the whole")
        if {self.form, *(card.form for card in used)} != {"displacement"}:
            raise ValueError("modules in a row are of form displacement")
