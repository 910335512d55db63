"""train.yaml: which dataset, which kind of model, where to."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt

from cfem.core.spec import Spec


class SpectralSpec(Spec):
    """The energy model in Chebyshev polynomials. Cross-validation chooses degrees and weights."""

    kind: Literal["spectral"]
    """One potential as a Chebyshev series."""
    form: Literal["displacement", "force"] = "displacement"
    """What the model is a function of: displacements or forces of the actuators."""
    max_degree: Annotated[int, Field(ge=2, le=40)] = 16
    """Largest degree of a polynomial. Stiffness is a second derivative, so 2 at least."""
    max_terms: Annotated[int, Field(ge=1, le=10_000)] = 2000
    """Largest number of terms of one series."""
    folds: Annotated[int, Field(ge=2, le=20)] = 5
    """Number of folds of the cross-validation."""


Activation = Literal["relu", "tanh", "silu"]
Share = Annotated[float, Field(ge=0, lt=1)]


class MlpSpec(Spec):
    """The paper's network, one output per entry of W and delta_free."""

    kind: Literal["mlp"]
    """The paper's network of entries."""
    form: Literal["displacement", "force"] = "displacement"
    """What the model is a function of: displacements or forces of the actuators."""
    at_rest: Path | None = None
    """Folder of a model of the same robots. Its W and delta_free at rest are then inputs instead of the
    parameters."""
    depth: PositiveInt = 3
    """Number of hidden layers."""
    width: PositiveInt = 450
    """Width of a hidden layer."""
    activation: Activation = "relu"
    """Activation function."""
    dropout: Share = 0.0
    """Share of units dropped in training."""
    learning_rate: PositiveFloat = 1e-3
    """Learning rate at the start."""
    schedule: Literal["plateau", "cosine"] = "cosine"
    """How the learning rate falls."""
    batch_size: PositiveInt = 64
    """Rows per step."""
    epochs: PositiveInt = 1500
    """Largest number of epochs."""
    patience: PositiveInt = 500
    """Training ends after this many epochs without a better one on validation rows."""
    seed: NonNegativeInt = 0
    """Seed of the random numbers."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """auto takes a GPU where there is one."""


class ModuleSpec(Spec):
    """One module of a row."""

    model: Path
    """Folder of the model of such a module, which has form displacement; its effectors are its end with its
    orientation, and its centre of mass where the row is to bear gravity."""
    softer: PositiveFloat = 1.0
    """Its compliance relative to that model: the Young's modulus there over its own."""


class SerialSpec(Spec):
    """Modules in a row, each from the model of one. The dataset, of the whole robot, only judges."""

    kind: Literal["serial"]
    """Modules in a row."""
    modules: Annotated[tuple[ModuleSpec, ...], Field(min_length=1)]
    """The modules, from the base on."""


ModelSpec = Annotated[SpectralSpec | MlpSpec | SerialSpec, Field(discriminator="kind")]


class TrainSpec(Spec):
    """Which dataset, which kind of model, and where to store it."""

    dataset: Path
    """Folder of `cfem sample`."""
    out: Path
    """Folder for the model."""
    model: ModelSpec
    """Kind of model and its settings."""
    samples: Annotated[int, Field(ge=4)] | None = None
    """How many of the first training rows to use. All unless given."""
    skin: bool = True
    """Whether to learn the whole surface, where the samples have its modes."""
    learning_curve: tuple[Annotated[int, Field(ge=4)], ...] = ()
    """Numbers of rows at which the model is trained as well, judged on the same test rows."""
