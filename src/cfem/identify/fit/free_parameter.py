"""A number that a fit looks for, as a coordinate z of size one, and its estimate with intervals."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed.parameters import Parameter, coordinates, range_coordinates, values

_END = 1e-5  # share of its range within which an estimate lies at an end of it


@dataclass(frozen=True)
class FreeParameter:
    """A parameter, whose coordinate is origin + z scale.

    name:      of the unknown, for people
    parameter: unit, range, reference and coordinate
    origin:    coordinate at z = 0
    scale:     of z in that coordinate"""

    name: str
    parameter: Parameter
    origin: float
    scale: float

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds of z: the ends of the parameter's range."""
        ends = [(float(end[0]) - self.origin) / self.scale for end in range_coordinates([self.parameter])]
        return min(ends), max(ends)

    def value(self, z: float) -> float:
        """The parameter's value at z, in its unit."""
        return float(values([self.parameter], np.array([self.origin + z * self.scale]))[0])


def share_of_range(parameter: Parameter) -> FreeParameter:
    """The unknown whose z is the share of its range, from 0 to 1."""
    low, high = (float(end[0]) for end in range_coordinates([parameter]))
    return FreeParameter(parameter.name, parameter, low, high - low)


def from_reference(name: str, parameter: Parameter, scale: float) -> FreeParameter:
    """The unknown whose z is 0 at the parameter's reference; scale: of z in its coordinate."""
    (origin,) = coordinates([parameter], np.array([parameter.reference]))
    return FreeParameter(name, parameter, float(origin), scale)


@dataclass(frozen=True)
class ParameterEstimate:
    """The estimate of one unknown.

    name, unit: of the parameter
    value:     in its unit
    interval:  its ends, within the parameter's range; None where it is not determined
    profile:   interval by the profile of the likelihood, None at an end beyond the range; None where not computed
    deviation: standard deviation of z, None where not determined
    at_end:    whether the value lies at an end of the parameter's range"""

    name: str
    unit: str
    value: float
    interval: tuple[float | None, float | None]
    profile: tuple[float | None, float | None] | None
    deviation: float | None
    at_end: bool


def estimate(
    unknown: FreeParameter,
    z: float,
    deviation: float,
    quantile: float,
    profile: tuple[float | None, float | None] | None = None,
) -> ParameterEstimate:
    """The estimate at z with its interval.

    deviation: standard deviation of z, inf where not determined
    quantile:  standard deviations of half of the interval
    profile:   ends of the interval of z by the profile of the likelihood"""
    low, high = unknown.bounds
    determined = bool(np.isfinite(deviation))
    half = quantile * deviation
    ends = sorted(unknown.value(float(np.clip(z + side * half, low, high))) for side in (-1, 1)) if determined else ()
    return ParameterEstimate(
        unknown.name,
        unknown.parameter.unit,
        unknown.value(z),
        (ends[0], ends[1]) if determined else (None, None),
        None if profile is None else tuple(None if end is None else unknown.value(end) for end in profile),
        float(deviation) if determined else None,
        is_at_end(unknown, z, _END),
    )


def is_at_end(unknown: FreeParameter, z: float, share: float) -> bool:
    """True where z lies within a share of its range from an end of it."""
    low, high = unknown.bounds
    return bool(min(z - low, high - z) < share * (high - low))
