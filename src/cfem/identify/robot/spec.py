"""calibrate.yaml: which parameters, from which measurements, by which model."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, PositiveInt

from cfem.condensed.parameters import Value
from cfem.core.actuator_units import Displacement, Effort
from cfem.core.spec import Spec
from cfem.core.units import Length
from cfem.sample.spec import ParameterSpec

Source = Literal["effectors", "actuators"]


class NoiseSpec(Spec):
    """Standard deviation of each measured number."""

    effectors: Length = Field(gt=0)
    """Of effector positions."""
    forces: Effort | None = Field(None, gt=0)
    """Of the actuators' forces."""
    actuator_displacements: Displacement | None = Field(None, gt=0)
    """Of the actuators' displacements, where forces drive them."""


class CalibrateSpec(Spec):
    """Which parameters of the robot to find, from which measurements, with which model."""

    measurements: Path
    """A .yaml, .csv or .parquet table, or the folder of a dataset."""
    out: Path
    """Folder for the result."""
    model: Path | None = None
    """Folder of a model that takes parameters."""
    fe: bool = False
    """Whether to use finite elements instead of a model's predictions."""
    scene: Path | None = None
    """Scene of the elements; also needed where a model covers several shapes."""
    mesh: Path | None = None
    """Mesh of the elements."""
    parameters: dict[str, ParameterSpec] = {}
    """Parameters for finite elements without a model, as in sample.yaml."""
    split: Literal["train", "test"] = "train"
    """Split of the dataset that serves as measurements."""
    rows: list[Annotated[int, Field(ge=0)]] | None = None
    """Rows that serve as measurements, by their number in the file. All unless given."""
    use: list[Source] = Field(["effectors", "actuators"], min_length=1)
    """Which of the measured quantities to use."""
    driven: Literal["displacement", "force"] = "displacement"
    """What is known of the actuators. The other is measured."""
    find: list[str] | None = Field(None, min_length=1)
    """Parameters to find. All unless given."""
    fixed: dict[str, Value] = {}
    """Values of the other parameters. The scene's unless given."""
    starts: PositiveInt | list[dict[str, Value]] = 5
    """Starts of the search, or how many to spread over the ranges."""
    noise: NoiseSpec | None = None
    """Noise of the measurements. Estimated from the residuals of the fit unless given."""
    confidence: float = Field(0.95, gt=0, lt=1)
    """Level of the intervals."""
    profile: bool | None = None
    """Whether to compute intervals by profiles of the likelihood too. With a model, yes unless stated."""
    repeats: Annotated[int, Field(ge=0, le=10_000)] = 0
    """Number of simulated measurements with the stated noise, to count how many intervals cover the truth."""
    truth: dict[str, Value] = {}
    """True values, to compare with."""
    figure: bool = True
    """Whether to draw a figure."""

    def check(self) -> None:
        """Raises ValueError where fields do not go together."""
        if self.model is None and not self.fe:
            raise ValueError("needs a model, or fe: true with scene and mesh")
        if self.fe and (self.scene is None or self.mesh is None):
            raise ValueError("fe: true needs scene and mesh")
        if self.fe and self.model is None and not self.parameters:
            raise ValueError("fe: true needs parameters, or a model whose parameters they are")
        if self.model is not None and self.parameters:
            raise ValueError("parameters come from the model; leave out `parameters` or `model`")
        if self.repeats and self.noise is None:
            raise ValueError("repeats need a noise: state `noise`")
        if self.starts == []:
            raise ValueError("starts: needs at least one")
        for name, given in (("rows", self.rows), ("find", self.find)):
            twice = next((item for item in given or [] if given.count(item) > 1), None)
            if twice is not None:
                raise ValueError(f"{name}: {twice} stands there twice")
