"""Spec of `control.yaml`: five kinds of runs, told apart by a key that only one of them has."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Discriminator, Field, Tag

from cfem.control.closed_loop.run_spec import ClosedLoopSpec
from cfem.control.crawling.spec import CrawlingSpec
from cfem.control.holding.spec import HoldingSpec
from cfem.control.open_loop.spec import OpenLoopSpec
from cfem.control.task.obstacles.spec import ObstaclesSpec

# Key that makes a run one of this kind -> its name in an error.
MARKS = {"gait": "a gait", "object": "an object", "obstacles": "an obstacle", "loop": "a loop"}
FREE = "goals of a free robot"


def _kind_of(data: Any) -> str:
    """The kind that a document has; the first where it has the marks of several."""
    keys = data if isinstance(data, dict) else type(data).model_fields
    return next((name for key, name in MARKS.items() if key in keys), FREE)


def _without_empty_marks(data: Any) -> Any:
    """The document without marks that are null or empty, such as `--set loop=null`."""
    if not isinstance(data, dict):
        return data
    return {key: value for key, value in data.items() if key not in MARKS or value not in (None, {})}


ControlSpec = Annotated[
    Annotated[OpenLoopSpec, Tag(FREE)]
    | Annotated[ClosedLoopSpec, Tag(MARKS["loop"])]
    | Annotated[ObstaclesSpec, Tag(MARKS["obstacles"])]
    | Annotated[HoldingSpec, Tag(MARKS["object"])]
    | Annotated[CrawlingSpec, Tag(MARKS["gait"])],
    Discriminator(_kind_of),
    BeforeValidator(_without_empty_marks),
    Field(title="ControlSpec", description="Which models follow which goals, in which plant."),
]
