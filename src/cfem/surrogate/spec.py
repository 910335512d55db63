"""train.yaml: which dataset, which kind of model, where to."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, NonNegativeInt, PositiveFloat, PositiveInt, model_validator

from cfem.core.spec import Spec


class SpectralSpec(Spec):
    """The energy model in Chebyshev polynomials; degrees and weights are chosen by cross-validation. form: what it is
    a function of, displacements or forces of the actuators; max_terms: of one series."""

    kind: Literal["spectral"]
    form: Literal["displacement", "force"] = "displacement"
    max_degree: Annotated[int, Field(ge=1, le=40)] = 16
    max_terms: Annotated[int, Field(ge=1, le=10_000)] = 2000
    folds: Annotated[int, Field(ge=2, le=20)] = 5


Activation = Literal["relu", "tanh", "silu"]
Share = Annotated[float, Field(ge=0, lt=1)]
PAIR = Field(min_length=2, max_length=2)


class MlpRanges(Spec):
    """What a search varies: least and greatest, or the choices; what is not named keeps the model's value."""

    depth: Annotated[list[PositiveInt], PAIR] | None = None
    width: Annotated[list[PositiveInt], PAIR] | None = None
    activation: Annotated[tuple[Activation, ...], Field(min_length=1)] | None = None
    dropout: Annotated[list[Share], PAIR] | None = None
    learning_rate: Annotated[list[PositiveFloat], PAIR] | None = None
    batch_size: Annotated[list[PositiveInt], PAIR] | None = None

    @model_validator(mode="after")
    def _ordered(self) -> "MlpRanges":
        given = {name: values for name, values in self if values is not None}
        if not given:
            raise ValueError(f"name one or more of {', '.join(type(self).model_fields)}")
        for name, values in given.items():
            if name != "activation" and values[0] > values[1]:
                raise ValueError(f"{name}: {values[0]} is greater than {values[1]}")
        return self


class MlpSearch(Spec):
    """A search for the network, judged by validation rows. It ends after `trials`, and begins none after `seconds`;
    each trial trains for `epochs`, in which its schedule ends too."""

    over: MlpRanges
    trials: PositiveInt = 30
    seconds: PositiveFloat | None = None
    epochs: PositiveInt = 200


class MlpSpec(Spec):
    """The paper's network of entries. form: what it is a function of, displacements or forces of the actuators;
    at_rest: folder of a model of the same robots, whose W and delta_free at rest are then inputs in place of the
    parameters; depth, width: of its hidden layers; optimiser: muon takes larger batches and rates (225, 4e-3), reaches
    a lower loss with a smooth activation, and wants a processor with bfloat16 arithmetic; patience: epochs without a
    better one on validation rows after which training ends; device: auto is a GPU where there is one."""

    kind: Literal["mlp"]
    form: Literal["displacement", "force"] = "displacement"
    at_rest: Path | None = None
    depth: PositiveInt = 3
    width: PositiveInt = 450
    activation: Activation = "relu"
    dropout: Share = 0.0
    optimiser: Literal["adam", "muon"] = "adam"
    learning_rate: PositiveFloat = 1e-3
    schedule: Literal["plateau", "cosine"] = "cosine"
    batch_size: PositiveInt = 64
    epochs: PositiveInt = 1500
    patience: PositiveInt = 500
    seed: NonNegativeInt = 0
    device: Literal["auto", "cpu", "cuda"] = "auto"
    search: MlpSearch | None = None


class EnergyNetSpec(Spec):
    """The energy model in networks of sines. form: what it is a function of, displacements or forces of the actuators;
    depth, width: of the hidden layers of each quantity's network; patience: Gauss-Newton iterations without a better
    one on validation rows after which training ends."""

    kind: Literal["energy_net"]
    form: Literal["displacement", "force"] = "displacement"
    depth: PositiveInt = 2
    width: PositiveInt = 24
    iterations: PositiveInt = 300
    patience: PositiveInt = 40
    seed: NonNegativeInt = 0


class SerialSpec(Spec):
    """Equal modules in a row, without external load, from the model of one: of form displacement, its effector the
    module's end with its orientation. module: folder of that model; softer: how compliant each module is relative to
    it, from the base on: its Young's modulus over theirs. The dataset, of the whole robot, only judges."""

    kind: Literal["serial"]
    module: Path
    softer: Annotated[tuple[PositiveFloat, ...], Field(min_length=1)]


ModelSpec = Annotated[SpectralSpec | EnergyNetSpec | MlpSpec | SerialSpec, Field(discriminator="kind")]


class TrainSpec(Spec):
    """dataset: folder of `cfem simulate-sample`; samples: how many of its first training rows to use, all where absent;
    learning_curve: numbers of rows at which the model is trained as well, judged on the same test rows."""

    dataset: Path
    out: Path
    model: ModelSpec
    samples: Annotated[int, Field(ge=4)] | None = None
    learning_curve: tuple[Annotated[int, Field(ge=4)], ...] = ()
