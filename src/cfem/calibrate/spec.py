"""calibrate.yaml: which parameters, from which measurements, by which model."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PositiveInt, model_validator

from cfem.condensed.given import Value
from cfem.core.spec import Spec
from cfem.core.units import Force, Length
from cfem.sample.spec import ParameterSpec

Source = Literal["effectors", "actuators"]


class NoiseSpec(Spec):
    """Standard deviation of each measured number: of effectors, and of the actuators' forces (or of their
    displacements, where forces drive them, in actuator_displacements)."""

    effectors: Length = Field(gt=0)
    forces: Force | None = Field(None, gt=0)
    actuator_displacements: Length | None = Field(None, gt=0)


class CalibrateSpec(Spec):
    """measurements: a .yaml, .csv or .parquet table, or the folder of a dataset, of which split and rows (their numbers
    in the file) are taken for measurements. driven: what is known of the actuators; the rest is measured. use: of what
    was measured.

    model: folder of a model that takes parameters. fe: by finite elements instead, with the model's parameters or
    those in `parameters`, as sample.yaml has them; scene, mesh: of the elements, the scene also where a model is of
    several shapes. find: all parameters unless given; fixed: values of the others, the scene's unless given. starts:
    of the search, or how many spread over the ranges. noise: found from what the fit leaves unless given. profile:
    intervals by profiles of the likelihood as well; with a model unless said otherwise. repeats: of the measurement,
    simulated with the noise stated, in which intervals are counted that cover. truth: to compare with."""

    measurements: Path
    out: Path
    model: Path | None = None
    fe: bool = False
    scene: Path | None = None
    mesh: Path | None = None
    parameters: dict[str, ParameterSpec] = {}
    split: Literal["train", "test"] = "train"
    rows: list[Annotated[int, Field(ge=0)]] | None = None
    use: list[Source] = Field(["effectors", "actuators"], min_length=1)
    driven: Literal["displacement", "force"] = "displacement"
    find: list[str] | None = Field(None, min_length=1)
    fixed: dict[str, Value] = {}
    starts: PositiveInt | list[dict[str, Value]] = 5
    noise: NoiseSpec | None = None
    confidence: float = Field(0.95, gt=0, lt=1)
    profile: bool | None = None
    repeats: Annotated[int, Field(ge=0, le=10_000)] = 0
    truth: dict[str, Value] = {}
    figure: bool = True

    @model_validator(mode="after")
    def _has_a_robot(self) -> "CalibrateSpec":
        if self.model is None and not self.fe:
            raise ValueError("needs a model, or fe: true with scene and mesh")
        if self.fe and (self.scene is None or self.mesh is None):
            raise ValueError("fe: true needs scene and mesh")
        if self.fe and self.model is None and not self.parameters:
            raise ValueError("fe: true needs parameters, or a model whose parameters they are")
        if self.model is not None and self.parameters:
            raise ValueError("parameters are the model's; leave one of the two out")
        if self.repeats and self.noise is None:
            raise ValueError("repeats are simulated with a noise: state it")
        if self.starts == []:
            raise ValueError("starts: needs one at least")
        return self
