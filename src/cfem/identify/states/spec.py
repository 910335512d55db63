"""Spec of `estimate.yaml`: which recording, which markers, what may push."""

from pathlib import Path

from cfem.predict.estimation.spec import DrivenDynamicsSpec, MarkersSpec


class EstimateSpec(MarkersSpec):
    """Where the robot is and who pushes it, frame by frame, from recorded markers."""

    model: Path
    """Folder of a model with a skin."""
    recording: Path
    """Table of the frames, .csv or .parquet: columns `NAME.x [mm]`, `.y`, `.z` of each marker, and where they were
    recorded `time [s]`, `ACTUATOR.displacement [mm]`, `ACTUATOR.force [N]` and `ACTUATOR.command [mm]`."""
    out: Path
    """Folder for the result."""
    dynamics: DrivenDynamicsSpec | None = None
    """A robot that moves from frame to frame, of a model that has learned to. At rest in each frame unless given."""
    each_frame: bool = False
    """Whether each frame is estimated alone. All frames before it count otherwise."""
    truth: Path | None = None
    """Table of true forces and displacements, columns `ROW.force [N]` of the loaded rows and `ACTUATOR.displacement
    [mm]`, to compare with."""

    def check(self) -> None:
        """Raises ValueError where fields do not go together."""
        if self.dynamics is not None and self.each_frame:
            raise ValueError("dynamics go from frame to frame: leave out each_frame")
        if "time" in self.markers:
            raise ValueError("markers: 'time' names the column of times; give the marker another name")
