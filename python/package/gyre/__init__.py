"""Radar odometry: motions and trajectories from the scans of a spinning radar.

    import gyre

    config = gyre.Config.of("recording")
    odometry = gyre.Odometry(config)
    for scan in gyre.open("recording", config):
        registered = odometry.register(scan)
        print(registered.motion, registered.pose)
    odometry.trajectory.write_tum("trajectory.tum")

The poses of a run of processes, while it runs:

    for pose in gyre.Run("out/demo").poses():
        print(pose.stamp_ns, pose.x_m, pose.covariance)

Frames are those of REP-103: x forward, y left, yaw counter-clockwise; lengths in m, angles in rad, times in ns.
"""

from ._gyre import (
    Config,
    Dataset,
    Evaluation,
    Loop,
    Masked,
    Masker,
    Message,
    Messages,
    Odometry,
    Pose,
    Registered,
    Report,
    Run,
    Scan,
    Slam,
    Trajectory,
    __version__,
    evaluate,
    find_ground_truth,
    inspect,
    open,
)
from .errors import ConfigError, Error, ReadError, RunError, ScanError, SkippedScanWarning, TrajectoryError, WriteError
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
    "Message",
    "Messages",
    "Odometry",
    "Pose",
    "ReadError",
    "Registered",
    "Report",
    "Run",
    "RunError",
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
