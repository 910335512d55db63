"""predict.yaml: which load cases to predict, by which calibration."""

from pathlib import Path

from pydantic import Field

from cfem.core.spec import Spec


class PredictSpec(Spec):
    """Prediction of other load cases of a calibrated robot, with intervals and, where they were measured, errors."""

    cases: Path
    """The cases.yaml by which the robot was calibrated."""
    calibrated: Path
    """Folder that `cfem calibrate-cases` made of it."""
    table: Path
    """Table of the other load cases, in the layout of cases.yaml. The columns of places may be empty."""
    out: Path
    """Folder for the result."""
    average: bool = False
    """True: predict by the average of all models of cases.yaml (`find` and `compare`), weighed by their left-out
    cases. Intervals then hold how far the models differ."""
    beyond: float = Field(0.03, ge=0)
    """What the model may lack where forces exceed those of the calibration: standard deviation of a coordinate, as a
    share of the marker's displacement."""
    confidence: float = Field(0.95, gt=0, lt=1)
    """Level of the intervals."""
    figure: bool = True
    """Whether to draw a figure."""
