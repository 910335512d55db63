"""Status of a quasi-static step with contact, of learned robots and of finite elements."""

from enum import Enum


class StepStatus(Enum):
    """How a step ended; the value is the sentence that the user reads."""

    CONVERGED = "converged"
    NO_MODE = "no combination of open, sticking and sliding points is in equilibrium"
    ITERATIONS = (
        "no balance found in the rounds allowed: points keep opening, sticking and sliding, or the robot nearly buckles"
    )
    MANY = "more patches touch at once than may: take larger patches"
    SWAPPED = "one patch begins to press while another lets go: the step is too long for friction to know the way"
    NO_EQUILIBRIUM = "the robot finds no equilibrium with its contact points held"
