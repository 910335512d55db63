"""A recording to the places of named markers, at rest and under load, in the scene's frame."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError
from cfem.identify.recordings.naming import follow, name_markers
from cfem.identify.recordings.recording import MarkerRecording, make_recording
from cfem.identify.recordings.registration import Registration, register
from cfem.identify.recordings.settled import RestingFrames, settled
from cfem.identify.recordings.spec import MeasurementsSpec, RecordingSpec

_JUMP = 5.0  # mm from frame to frame: two markers that both do have swapped their names


@dataclass(frozen=True)
class Reduced:
    """A recording reduced to its settled stretches.

    numbers: number in the recording, by the marker's name
    rest:    before the load, None where the recording does not show it
    loaded:  under the load
    frame:   of the cameras on the scene's"""

    numbers: dict[str, int]
    rest: RestingFrames | None
    loaded: RestingFrames
    frame: Registration

    def place(self, name: str, rest: RestingFrames) -> np.ndarray:
        """Place (3,) mm of a marker in the scene's frame, nan where it was hidden."""
        return self.frame(rest.mean[self.numbers[name]]) if name in self.numbers else np.full(3, np.nan)

    def noise(self, name: str) -> np.ndarray:
        """Standard deviation (3,) mm of a marker about the mean in the settled stretch, along the scene's axes."""
        if name not in self.numbers:
            return np.full(3, np.nan)
        return np.sqrt(self.frame.turn**2 @ self.loaded.sd[self.numbers[name]] ** 2)


def reduce_recording(recording: MarkerRecording, recording_spec: RecordingSpec, spec: MeasurementsSpec) -> Reduced:
    """The markers at rest and under load, named and in the scene's frame. InputError naming the file where it never
    settles, its frame cannot be laid or its markers not be named."""
    tracks = follow(recording.points, _JUMP)
    recording = make_recording(recording.time, list(recording.labels), tracks, recording.source)
    rests = settled(recording, spec.settle.window, spec.settle.within)
    if spec.rest and len(rests) < 2:
        what = f"settles only once, from {recording.time[rests[0].first]:.2f} s on: it shows no rest before the load"
        raise InputError(what, where=recording.source, do="record from before the load, or set rest: false")
    first, last = rests[0], rests[-1]
    places = {name: np.asarray(place, float) for name, place in spec.markers.items()}
    by = spec.registration.by or list(places)
    shown = {name: places[name] for name in (places if spec.rest else by)}
    tolerance = spec.registration.tolerance
    numbers = _labelled(recording, recording_spec) or name_markers(
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


def _named(recording: MarkerRecording, name: str) -> list[int]:
    """Number of the first marker whose label ends with the name, if any."""
    return [i for i, label in enumerate(recording.labels) if label.lower().endswith(name.lower())][:1]


def _labelled(recording: MarkerRecording, recording_spec: RecordingSpec) -> dict[str, int]:
    """Numbers of the markers whose labels the user names, by name. InputError where the recording has no such label."""
    numbers = {}
    for label, name in recording_spec.labels.items():
        if label not in recording.labels:
            what = f"has no marker '{label}', only {', '.join(recording.labels)}"
            raise InputError(what, where=recording.source, do="correct `labels`")
        numbers[name] = recording.labels.index(label)
    return numbers
