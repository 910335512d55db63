"""What a filter on the dynamics assumes of the robot, as standard deviations."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError
from cfem.predict.estimation.spec import DynamicsSpec

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
    spec: DynamicsSpec | None, slip: float, offset: float, lasts: float, length: float
) -> MotionUncertainty:
    """The uncertainty that a spec states; slip, offset, lasts: as in `MotionUncertainty`; length: mm, the robot's."""
    spec = spec or DynamicsSpec()
    swing = SWING * length if spec.swing is None else spec.swing
    return MotionUncertainty(slip, offset, swing, spec.push, spec.stiffness, spec.wander, lasts)
