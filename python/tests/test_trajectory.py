"""Trajectories, their files and their evaluation."""

from pathlib import Path
from typing import Any

import gyre
import numpy as np
import pytest


def straight(count: int = 200, step_m: float = 1.0) -> gyre.Trajectory:
    poses = np.zeros((count, 3))
    poses[:, 0] = step_m * np.arange(count)
    poses[:, 2] = 0.1 * np.sin(np.arange(count))
    return gyre.Trajectory(np.arange(count) * 250_000_000, poses)


def test_a_trajectory_is_read_as_it_was_written(tmp_path: Path) -> None:
    given = straight()
    given.write_tum(tmp_path / "a.tum")
    read = gyre.Trajectory.read(tmp_path / "a.tum")
    assert read.stamp_ns is not None and given.stamp_ns is not None
    assert np.array_equal(read.stamp_ns, given.stamp_ns)
    assert np.allclose(read.poses, given.poses, atol=1e-6)
    given.write_kitti(tmp_path / "a.txt")
    without_times = gyre.Trajectory.read(tmp_path / "a.txt")
    assert without_times.stamp_ns is None
    assert len(without_times) == 200 and abs(without_times.path_m - 199) < 1e-6


def test_an_evaluation_has_its_figures(tmp_path: Path) -> None:
    evaluation = gyre.evaluate(straight(step_m=1.01), straight())
    assert evaluation.translation_percent is not None
    assert abs(evaluation.translation_percent - 1.0) < 0.05
    assert evaluation.to_dict()["ate"]["rmse_m"] == evaluation.ate_m > 0
    assert "KITTI" in str(evaluation)
    for name, plot in (("a.svg", evaluation.plot), ("b.svg", evaluation.plot_errors), ("c.svg", straight().plot)):
        plot(tmp_path / name)
        assert (tmp_path / name).read_text().startswith("<svg")
    short = gyre.evaluate(straight(5), straight(5))
    assert short.translation_percent is None


def test_poses_can_be_given_one_by_one() -> None:
    scan = gyre.Scan(np.zeros((4, 9), np.uint8), stamp_ns=0, sweep_s=0.1, range_resolution_m=1.0, clockwise=False)
    pose = gyre.Odometry().register(scan).pose
    trajectory = gyre.Trajectory([0, 1], [pose, pose])
    assert np.array_equal(trajectory.poses, np.zeros((2, 3)))
    assert pose.matrix.tolist() == np.eye(3).tolist() and pose.covariance.shape == (3, 3)


def test_packed_records_and_misaligned_buffers_are_read_as_numpy_reads_them() -> None:
    records = np.zeros(5, [("ok", "u1"), ("stamp_ns", "<i8"), ("pose", "<f8", 3)])
    records["ok"], records["stamp_ns"], records["pose"] = 255, np.arange(5) * 10**8, np.arange(15).reshape(5, 3) / 10
    stamps, poses = records["stamp_ns"].copy(), records["pose"].copy()
    misaligned = [np.frombuffer(b"\0" + array.tobytes(), array.dtype, offset=1) for array in (stamps, poses)]
    for given_stamps, given_poses in (
        (records["stamp_ns"], records["pose"]),
        (misaligned[0], misaligned[1].reshape(5, 3)),
        (stamps.astype(">i8"), poses.astype(">f8")),
        (np.repeat(stamps, 2)[::2], np.asfortranarray(poses)),
    ):
        trajectory = gyre.Trajectory(given_stamps, given_poses)
        assert np.array_equal(np.array(trajectory.stamp_ns), stamps)
        assert np.allclose(trajectory.poses, poses, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("stamps", "poses"),
    [
        ([0], np.zeros((2, 3))),
        ([1, 0], np.zeros((2, 3))),
        (None, np.zeros((2, 4))),
        (None, np.full((2, 3), np.nan)),
        (None, np.zeros(3)),
        (None, None),
        (None, "poses"),
        ([0.5, 1.5], np.zeros((2, 3))),
        ("ab", np.zeros((2, 3))),
    ],
    ids=str,
)
def test_what_is_no_trajectory_is_refused(stamps: Any, poses: Any) -> None:
    with pytest.raises((gyre.TrajectoryError, TypeError, ValueError)):
        gyre.Trajectory(stamps, poses)


def test_files_that_cannot_be_read_or_written_are_errors(tmp_path: Path) -> None:
    (tmp_path / "a.tum").write_text("this is\nno trajectory\n")
    for path in (tmp_path / "a.tum", tmp_path / "missing"):
        with pytest.raises(gyre.ReadError, match=path.name):
            gyre.Trajectory.read(path)
    with pytest.raises(gyre.WriteError, match="missing"):
        straight().write_tum(tmp_path / "missing/a.tum")
    with pytest.raises(gyre.TrajectoryError, match="requires times"):
        gyre.Trajectory(None, np.zeros((2, 3))).write_tum(tmp_path / "b.tum")
    with pytest.raises(gyre.TrajectoryError, match="no pose"):
        gyre.Odometry().trajectory.plot(tmp_path / "b.svg")
    with pytest.raises(gyre.TrajectoryError, match="overlap"):
        gyre.evaluate(straight(), gyre.Trajectory([10**18, 10**18 + 1], np.zeros((2, 3))))
