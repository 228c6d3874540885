"""What `gyre-odometry` computes of a recording, and the files that it leaves."""

import json
import time
import warnings
from pathlib import Path

import gyre
import numpy as np

COLUMNS = (
    "seq,scan,stamp_ns,interval_ns,x_m,y_m,yaw_rad,cov_xx,cov_xy,cov_xyaw,cov_yy,cov_yyaw,cov_yawyaw,outcome,stationary"
)

RESULTS = (
    "odometry.csv",
    *(f"trajectory{of}{kind}" for of in ("", "_slam") for kind in (".tum", "_kitti.txt", ".svg")),
    "evaluation.json",
    "evaluation_slam.json",
)


def row(scan: gyre.Scan, registered: gyre.Registered) -> str:
    """A row of odometry.csv, with the digits of `gyre run`."""
    motion = registered.motion
    xy_yaw = [f"{value:.9f}" for value in (motion.x_m, motion.y_m, motion.yaw_rad)]
    covariance = [f"{value:.12f}" for value in motion.covariance[np.triu_indices(3)]]
    numbers = [registered.seq, scan.index, registered.stamp_ns, registered.interval_ns]
    return ",".join([*map(str, numbers), *xy_yaw, *covariance, registered.outcome, str(int(registered.stationary))])


class Drive:
    """Registers scans, closes loops if `slam.kind` says so, and writes the results into the folder `out` in place of those of an earlier call."""

    def __init__(self, config: gyre.Config, out: Path, truth: gyre.Trajectory | None, visualize: bool) -> None:
        if (out / "journal").exists():
            raise gyre.WriteError(f"{out} holds the results of `gyre run`, which are not overwritten: name another folder by --out")
        out.mkdir(parents=True, exist_ok=True)
        self.out, self.truth = out, truth
        self.odometry = gyre.Odometry(config)
        self.slam = None if config.to_dict()["slam"]["kind"] == "none" else gyre.Slam(config)
        self.viewer = None
        if visualize:
            from gyre.visualize import Viewer  # matplotlib is optional

            self.viewer = Viewer()
        self.rows, self.registered = [COLUMNS], 0
        self.written: set[str] = set()
        # Those of another drive would pass for this one's.
        for name in RESULTS:
            (out / name).unlink(missing_ok=True)
        self.result("config.toml").write_text(str(config))
        self.began = time.monotonic()

    def register(self, scan: gyre.Scan) -> None:
        """Registers a scan. One that cannot be used is skipped with a warning."""
        try:
            registered = self.odometry.register(scan)
        except gyre.ScanError as error:
            warnings.warn(f"skipped: scan {scan.index}: {error}", gyre.SkippedScanWarning, stacklevel=1)
            return
        self.registered += 1
        if registered.outcome != "start":
            self.rows.append(row(scan, registered))
        if self.slam:
            self.slam.add(registered, self.odometry.points)
        if self.viewer:
            self.viewer.show(registered, self.odometry.points)

    def write(self) -> str:
        """Writes the results of one scan or more, and returns a summary of them."""
        trajectory = self.odometry.trajectory
        rate = len(trajectory) / (time.monotonic() - self.began)
        lines = [f"{len(trajectory)} scans, {trajectory.path_m:.1f} m, {rate:.1f} scans/s"]
        self.result("odometry.csv").write_text("\n".join(self.rows) + "\n")
        lines += self.write_trajectory(trajectory, "trajectory", "evaluation.json")
        if self.slam:
            self.slam.finish()
            lines.append(f"{sum(loop.weight > 0 for loop in self.slam.loops)} loops, and the trajectory corrected by them:")
            lines += self.write_trajectory(self.slam.trajectory, "trajectory_slam", "evaluation_slam.json")
        return "\n".join([*lines, f"results in {self.out}: {', '.join(sorted(self.written))}"])

    def result(self, name: str) -> Path:
        """The file of a result, which the summary lists."""
        self.written.add(name)
        return self.out / name

    def write_trajectory(self, trajectory: gyre.Trajectory, name: str, figures: str) -> list[str]:
        """Writes a trajectory as TUM, KITTI and SVG, and its errors where there is a ground truth."""
        trajectory.write_tum(self.result(f"{name}.tum"))
        trajectory.write_kitti(self.result(f"{name}_kitti.txt"))
        trajectory.plot(self.result(f"{name}.svg"))
        if self.truth is None:
            return ["no ground truth: nothing is evaluated"]
        try:
            evaluation = gyre.evaluate(trajectory, self.truth)
        except gyre.TrajectoryError as error:
            return [f"not evaluated: {error}"]
        evaluation.plot(self.result(f"{name}.svg"))
        self.result(figures).write_text(json.dumps(evaluation.to_dict(), indent=2) + "\n")
        return [str(evaluation)]
