"""Standard deviations that a filter on the dynamics assumes of the robot."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError
from cfem.predict.estimation.filter import slip_and_offset
from cfem.predict.estimation.spec import DynamicsSpec, MarkersSpec
from cfem.predict.protocol import Predictor

SWING = 0.05  # of the robot's length, where a spec states none


@dataclass(frozen=True)
class MotionUncertainty:
    """Standard deviations of a moving robot's state and noise.

    slip: mm by which an actuator moves in a second beside its command (root of)
    offset: mm, distance of an actuator from its first command
    swing: mm, vibration of the effectors at the start
    push: mm by which forces that the model does not know move the effectors in a hundredth of a second, at rest (root
        of)
    stiffness: of the stiffness's logarithm at the start
    wander: change of that logarithm in a second, as a share of `stiffness`
    lasts: s for which a load keeps its value
    """

    slip: float
    offset: float
    swing: float
    push: float = 0.03
    stiffness: float = 0.1
    wander: float = 0.1
    lasts: float = np.inf

    def __post_init__(self) -> None:
        if min(self.slip, self.offset, self.push, self.swing, self.lasts) <= 0:
            raise InputError("slip, offset, push, swing and the time for which a load lasts must be positive")


def motion_uncertainty(
    spec: MarkersSpec, model: Predictor, rate: float, lasts: float | None = None
) -> MotionUncertainty:
    """Uncertainty of a robot with this model that a spec states for `rate` frames a second. lasts: s for which a load
    keeps its value, as the spec says unless given."""
    dynamics, (slip, offset) = spec.dynamics or DynamicsSpec(), slip_and_offset(spec, model)
    swing = SWING * model.length if dynamics.swing is None else dynamics.swing
    lasts = spec.lasts if lasts is None else lasts
    slip *= np.sqrt(rate)
    return MotionUncertainty(slip, offset, swing, dynamics.push, dynamics.stiffness, dynamics.wander, lasts)
