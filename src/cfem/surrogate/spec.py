"""train.yaml: which dataset, which kind of model, where to."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt

from cfem.core.spec import Spec


class SpectralSpec(Spec):
    """The energy model in Chebyshev polynomials; degrees are chosen by cross-validation."""

    kind: Literal["spectral"]
    max_degree: Annotated[int, Field(ge=1, le=40)] = 16
    folds: Annotated[int, Field(ge=2, le=20)] = 5


class MlpSpec(Spec):
    """The paper's network of entries."""

    kind: Literal["mlp"]
    depth: PositiveInt = 3
    width: PositiveInt = 450
    activation: Literal["relu", "tanh", "silu"] = "relu"
    dropout: Annotated[float, Field(ge=0, lt=1)] = 0.0
    learning_rate: PositiveFloat = 1e-3
    schedule: Literal["plateau", "cosine"] = "cosine"
    batch_size: PositiveInt = 64
    epochs: PositiveInt = 1500
    patience: PositiveInt = 500
    seed: NonNegativeInt = 0


class TrainSpec(Spec):
    """dataset: folder of `cfem simulate-sample`; samples: how many of its first training rows to use, all where absent;
    learning_curve: numbers of rows at which the model is trained as well, judged on the same test rows."""

    dataset: Path
    out: Path
    model: Annotated[SpectralSpec | MlpSpec, Field(discriminator="kind")]
    samples: Annotated[int, Field(ge=4)] | None = None
    learning_curve: tuple[Annotated[int, Field(ge=4)], ...] = ()
