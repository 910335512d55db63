"""A recording to the places of named markers, at rest and under load, in the scene's frame."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError
from cfem.measurements.naming import follow, name_markers
from cfem.measurements.recording import Recording, make_recording
from cfem.measurements.registration import Registration, register
from cfem.measurements.settled import Stretch, settled
from cfem.measurements.spec import MeasurementsSpec, RecordingSpec

_JUMP = 5.0  # mm from frame to frame: two markers that both do have swapped their names


@dataclass(frozen=True)
class Reduced:
    """numbers: of each marker's name, its number in the recording; rest and loaded: the stretches, the first None where
    the recording shows no rest; sd (3,) mm noise of each name; frame: of the cameras on the scene's."""

    numbers: dict[str, int]
    rest: Stretch | None
    loaded: Stretch
    frame: Registration

    def place(self, name: str, stretch: Stretch) -> np.ndarray:
        """(3,) mm in the scene's frame, nan where the marker was hidden."""
        return self.frame(stretch.mean[self.numbers[name]]) if name in self.numbers else np.full(3, np.nan)

    def noise(self, name: str) -> np.ndarray:
        """(3,) mm standard deviation about the mean in the settled stretch, along the scene's axes."""
        if name not in self.numbers:
            return np.full(3, np.nan)
        return np.sqrt(self.frame.turn**2 @ self.loaded.sd[self.numbers[name]] ** 2)


def reduce_recording(recording: Recording, asked: RecordingSpec, spec: MeasurementsSpec) -> Reduced:
    """InputError naming the file where it never settles, its frame cannot be laid or its markers not be named."""
    tracks = follow(recording.points, _JUMP)
    recording = make_recording(recording.time, list(recording.labels), tracks, recording.source)
    calm = settled(recording, spec.settle.window, spec.settle.within)
    if spec.rest and len(calm) < 2:
        what = f"settles only once, from {recording.time[calm[0].first]:.2f} s on: it shows no rest before the load"
        raise InputError(what, where=recording.source, do="record from before the load, or set rest: false")
    first, last = calm[0], calm[-1]
    places = {name: np.asarray(place, float) for name, place in spec.markers.items()}
    by = spec.registration.by or list(places)
    shown = {name: places[name] for name in (places if spec.rest else by)}
    tolerance = spec.registration.tolerance
    numbers = _labelled(recording, asked) or name_markers(
        first.mean, recording.labels, shown, tolerance, recording.source
    )
    if not spec.rest:  # those that move have no known places: by their labels
        known = {name: i for name in places if name not in by for i in _named(recording, name)}
        numbers = known | numbers
    seen = [name for name in by if name in numbers and np.isfinite(first.mean[numbers[name]]).all()]
    frame = register(
        first.mean[[numbers[name] for name in seen]], np.array([places[name] for name in seen]).reshape(-1, 3),
        recording.source, tolerance,
    )  # fmt: skip
    return Reduced(numbers, first if spec.rest else None, last, frame)


def _named(recording: Recording, name: str) -> list[int]:
    """Number of the marker whose label ends with the name."""
    found = [i for i, label in enumerate(recording.labels) if label.lower().endswith(name.lower())]
    return found[:1]


def _labelled(recording: Recording, asked: RecordingSpec) -> dict[str, int]:
    """By the labels that the user names."""
    found = {}
    for label, name in asked.labels.items():
        if label not in recording.labels:
            what = f"has no marker '{label}', only {', '.join(recording.labels)}"
            raise InputError(what, where=recording.source, do="correct `labels`")
        found[name] = recording.labels.index(label)
    return found
