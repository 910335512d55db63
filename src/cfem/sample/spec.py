"""What the user writes in sample.yaml."""

from pathlib import Path
from typing import Literal

from pydantic import Field, model_validator

from cfem.core.spec import Spec


class SplitSpec(Spec):
    """One set of states. In `random` and `scrambled-halton` row i depends on the seed and on i alone, so that more rows
    extend a set; in `grid` (ends included; rows = k^actuators) and `latin-hypercube` it depends on their number too."""

    rows: int = Field(ge=1, le=10_000_000)
    method: Literal["scrambled-halton", "random", "grid", "latin-hypercube"]
    seed: int = Field(0, ge=0, lt=2**63)


class SampleSpec(Spec):
    """space: 'pulling' draws shares of a pull on all actuators (no actuator ever pushes); 'displacement' draws from the
    box of actuator displacements.

    skeleton, shard: number of states solved first, from which all others start, and largest number of states in one
    unit of work. The dataset depends on both to rounding, and on the number of workers not at all."""

    scene: Path
    mesh: Path
    out: Path
    space: Literal["pulling", "displacement"] = "pulling"
    splits: dict[Literal["train", "test"], SplitSpec] = Field(min_length=1)
    skeleton: int = Field(16, ge=1)
    shard: int = Field(50, ge=1)
    tolerance: float = Field(1e-10, gt=0, le=1e-6, description="largest relative residual of a converged state")

    @model_validator(mode="after")
    def _splits_differ(self) -> "SampleSpec":
        drawn = [(split.method, split.seed) for split in self.splits.values() if split.method != "grid"]
        drawn += [(split.method, 0) for split in self.splits.values() if split.method == "grid"]
        if len(set(drawn)) < len(drawn):
            raise ValueError("train and test share method and seed, hence rows; give them different seeds")
        return self
