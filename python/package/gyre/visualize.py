"""The window of `gyre-odometry --visualize`, drawn by matplotlib (`pip install gyre[visualize]`)."""

import os
from typing import Any

import gyre
import numpy as np
from numpy.typing import NDArray

try:
    import matplotlib.pyplot as plt
except ImportError:
    raise gyre.Error("--visualize needs matplotlib: install it, or gyre[visualize]") from None

VIEW_M = 100.0


class Viewer:
    """A map, seen from above in the frame of the first scan, that follows the vehicle: returns so far, those of the last scan, path."""

    def __init__(self) -> None:
        if plt.get_backend().lower() == "agg" and "MPLBACKEND" not in os.environ:
            raise gyre.Error("--visualize needs a display, and one of matplotlib's toolkits, such as PyQt6")
        self.figure, self.axes = plt.subplots(figsize=(8, 8))
        self.axes.set(aspect="equal", xlabel="x, m", ylabel="y, m")
        (self.map,) = self.axes.plot([], [], ",", color="0.6")
        (self.returns,) = self.axes.plot([], [], ".", markersize=2, color="tab:orange")
        (self.path,) = self.axes.plot([], [], color="tab:blue")
        self.mapped: list[NDArray[np.float64]] = []
        self.poses: list[tuple[float, float]] = []

    def show(self, registered: gyre.Registered, points: NDArray[Any]) -> None:
        """Draws a registered scan with its points."""
        pose = registered.pose
        in_sensor = np.stack([points["x_m"], points["y_m"], np.ones(len(points))])
        returns = (pose.matrix @ in_sensor)[:2]
        self.poses.append((pose.x_m, pose.y_m))
        if registered.seq % 10 == 0:
            self.mapped.append(returns)
            self.map.set_data(*np.concatenate(self.mapped, axis=1))
        self.returns.set_data(*returns)
        self.path.set_data(*np.transpose(self.poses))
        self.axes.set(xlim=(pose.x_m - VIEW_M, pose.x_m + VIEW_M), ylim=(pose.y_m - VIEW_M, pose.y_m + VIEW_M))
        self.axes.set_title(f"scan {registered.seq}: {registered.outcome}, {len(points)} returns")
        self.figure.canvas.draw_idle()
        self.figure.canvas.flush_events()
        plt.pause(0.001)
