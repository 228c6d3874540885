"""Gyre's motions as an input of an external filter, by the conventions of ROS and robot_localization.

    python examples/python-robot-localization.py RECORDING [CONFIG.toml]

prints a `nav_msgs/Odometry` as it is to be published, and fuses the motions with simulated wheels and a simulated gyro, without ROS:
by the update that a Kalman filter makes of two measurements of one velocity. The settings of `ekf_node` for the same are in
robot_localization.yaml. The recording needs a ground truth, of which wheels and gyro are simulated.
"""

import json
import sys
from itertools import takewhile
from typing import Any

import gyre
import numpy as np
from numpy.typing import NDArray

UNKNOWN = 1e6  # variance of what a planar radar does not measure: z, roll, pitch
AXES = [0, 1, 5]  # x, y and yaw among x, y, z, roll, pitch, yaw
Floats = NDArray[np.float64]


def twist(registered: gyre.Registered) -> tuple[Floats, Floats]:
    """The velocity of the radar in its own frame in the middle of the interval, m/s and rad/s, with its covariance.

    A scan whose outcome is `start` has no motion, and so no velocity.
    """
    motion, dt = registered.motion, registered.interval_ns * 1e-9
    half = -0.5 * motion.yaw_rad  # a motion is along the axes of the earlier scan
    turn = np.array([[np.cos(half), -np.sin(half), 0], [np.sin(half), np.cos(half), 0], [0, 0, 1]])
    velocity = turn @ [motion.x_m, motion.y_m, motion.yaw_rad] / dt
    return velocity, turn @ motion.covariance @ turn.T / dt**2


def in_ros_order(covariance: Floats) -> list[float]:
    """A covariance of (x, y, yaw) as one of (x, y, z, roll, pitch, yaw), row by row."""
    full = np.diag([UNKNOWN] * 6)
    full[np.ix_(AXES, AXES)] = covariance
    return [float(value) for value in full.flat]


def message(registered: gyre.Registered) -> dict[str, Any]:
    """A `nav_msgs/Odometry`: pose of the radar in `odom`, twist in the radar's frame. `base_link` -> `radar` is a static transform.

    Both are those in the middle of the interval: a message has one stamp. There is none of a scan whose outcome is `start`.
    """
    half_ns = registered.interval_ns // 2
    stamp_ns, pose, (velocity, covariance) = registered.stamp_ns - half_ns, registered.pose, twist(registered)
    x_m, y_m, yaw_rad = moved(np.array([pose.x_m, pose.y_m, pose.yaw_rad]), velocity, -half_ns * 1e-9)
    return {
        "header": {"stamp": {"sec": stamp_ns // 10**9, "nanosec": stamp_ns % 10**9}, "frame_id": "odom"},
        "child_frame_id": "radar",
        "pose": {
            "pose": {
                "position": {"x": x_m, "y": y_m, "z": 0.0},
                "orientation": {"x": 0.0, "y": 0.0, "z": np.sin(yaw_rad / 2), "w": np.cos(yaw_rad / 2)},
            },
            "covariance": in_ros_order(pose.covariance),
        },
        "twist": {
            "twist": {
                "linear": {"x": velocity[0], "y": velocity[1], "z": 0.0},
                "angular": {"x": 0.0, "y": 0.0, "z": velocity[2]},
            },
            "covariance": in_ros_order(covariance),
        },
    }


def fuse(a: tuple[Floats, Floats], b: tuple[Floats, Floats]) -> Floats:
    """Two measurements of a velocity, each weighted by the inverse of its covariance."""
    weights = [np.linalg.inv(covariance) for _, covariance in (a, b)]
    return np.linalg.solve(sum(weights), weights[0] @ a[0] + weights[1] @ b[0])


def moved(pose: Floats, velocity: Floats, dt: float) -> Floats:
    """The pose (x, y, yaw) after a time at a velocity."""
    middle = pose[2] + 0.5 * velocity[2] * dt
    step = [np.cos(middle) * velocity[0] - np.sin(middle) * velocity[1], np.sin(middle) * velocity[0] + np.cos(middle) * velocity[1]]
    return pose + np.array([*step, velocity[2]]) * dt


def truth_at(truth: gyre.Trajectory, stamp_ns: int) -> Floats:
    """The true pose (x, y, yaw) at a time."""
    assert truth.stamp_ns is not None
    columns = (truth.poses[:, 0], truth.poses[:, 1], np.unwrap(truth.poses[:, 2]))
    return np.array([np.interp(stamp_ns - truth.stamp_ns[0], truth.stamp_ns - truth.stamp_ns[0], column) for column in columns])


def wheels_and_gyro(before: Floats, after: Floats, dt: float, noise: np.random.Generator) -> tuple[Floats, Floats]:
    """The velocity of a vehicle that moves ahead, by wheels (0.2 m/s) and a gyro (0.3 deg/s), whose errors are independent."""
    forward = [np.cos((before[2] + after[2]) / 2), np.sin((before[2] + after[2]) / 2)]
    velocity = np.array([(after - before)[:2] @ forward / dt, 0.0, (after - before)[2] / dt])
    sigma = np.array([0.2, UNKNOWN, 0.005])  # wheels do not measure sideways
    return velocity + noise.normal(0, sigma * [1, 0, 1]), np.diag(sigma**2)


def main(recording: str, config_file: str | None = None) -> None:
    config = gyre.Config.read(config_file) if config_file else gyre.Config.of(recording)
    truth_file = gyre.find_ground_truth(recording)
    if truth_file is None:
        sys.exit(f"{recording} has no ground truth, of which wheels and gyro are simulated")
    truth, odometry, noise = gyre.Trajectory.read(truth_file), gyre.Odometry(config), np.random.default_rng(1)
    first, *later = [odometry.register(scan) for scan in gyre.open(recording, config)]
    # Behind a gap of the recording a new chain of motions starts, and nothing says how the radar came there.
    drive = [first, *takewhile(lambda registered: registered.outcome != "start", later)]
    if len(drive) == 1:
        sys.exit(f"{recording} has no motion: its second scan is not within 10 s after the first")
    true_poses = [truth_at(truth, registered.stamp_ns) for registered in drive]
    poses = dict.fromkeys(("wheels and gyro", "radar", "fused"), true_poses[0])
    for registered, before, after in zip(drive[1:], true_poses, true_poses[1:], strict=False):
        dt = registered.interval_ns * 1e-9
        radar, others = twist(registered), wheels_and_gyro(before, after, dt, noise)
        # A predicted motion is no measurement: a filter has a prediction of its own.
        fused = others[0] if registered.outcome == "predicted" else fuse(radar, others)
        for name, velocity in zip(poses, (others[0], radar[0], fused), strict=True):
            poses[name] = moved(poses[name], velocity, dt)
    print(json.dumps(message(drive[-1]), indent=1))
    differential = (drive[-2].pose.covariance + drive[-1].pose.covariance) * dt  # as robot_localization computes it
    sigmas = [np.sqrt(covariance[0, 0]) for covariance in (radar[1], differential)]
    print(f"sigma of vx: {sigmas[0]:.3f} m/s as a twist, {sigmas[1]:.3f} m/s from poses in differential mode")
    for name, pose in poses.items():
        error = pose - true_poses[-1]
        print(f"{name}: {np.hypot(*error[:2]):.2f} m and {np.degrees(abs(error[2])):.2f} deg off at the end")


if __name__ == "__main__":
    main(*sys.argv[1:])
