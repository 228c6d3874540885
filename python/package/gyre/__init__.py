"""Radar odometry: motions and trajectories from the scans of a spinning radar.

    import gyre

    config = gyre.Config.of("recording")
    odometry = gyre.Odometry(config)
    for scan in gyre.open("recording", config):
        registered = odometry.register(scan)
        print(registered.motion, registered.pose)
    odometry.trajectory.write_tum("trajectory.tum")

Frames are those of REP-103: x forward, y left, yaw counter-clockwise; lengths in m, angles in rad, times in ns.
"""

from ._gyre import (
    Config,
    Dataset,
    Evaluation,
    Loop,
    Masked,
    Masker,
    Odometry,
    Pose,
    Registered,
    Report,
    Scan,
    Slam,
    Trajectory,
    __version__,
    evaluate,
    find_ground_truth,
    inspect,
    open,
)
from .errors import ConfigError, Error, ReadError, ScanError, SkippedScanWarning, TrajectoryError, WriteError
from .objects import read_objects

__all__ = [
    "Config",
    "ConfigError",
    "Dataset",
    "Error",
    "Evaluation",
    "Loop",
    "Masked",
    "Masker",
    "Odometry",
    "Pose",
    "ReadError",
    "Registered",
    "Report",
    "Scan",
    "ScanError",
    "SkippedScanWarning",
    "Slam",
    "Trajectory",
    "TrajectoryError",
    "WriteError",
    "__version__",
    "evaluate",
    "find_ground_truth",
    "inspect",
    "open",
    "read_objects",
]
