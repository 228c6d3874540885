"""Loops, and the trajectory that is corrected by them."""

from pathlib import Path
from typing import Any

import gyre
import numpy as np
import pytest
from conftest import gyre_program


def test_loops_and_correction_are_those_of_a_run(around: Path, tmp_path: Path) -> None:
    data, out = around, tmp_path / "run"
    gyre_program("run", data, "--out", out, "--set", "slam.kind=graph")
    config = gyre.Config.of(data, {"slam.kind": "graph"})
    odometry, slam = gyre.Odometry(config), gyre.Slam(config)
    for scan in gyre.open(data, config):
        slam.add(odometry.register(scan), odometry.points)
    slam.finish()
    slam.trajectory.write_tum(tmp_path / "slam.tum")
    assert (tmp_path / "slam.tum").read_bytes() == (out / "trajectory_slam.tum").read_bytes()
    rows = [row.split(",") for row in (out / "loops.csv").read_text().splitlines()[1:]]
    used = [(int(row[1]), int(row[0])) for row in rows if row[-1] == "used"]
    found = [(loop.earlier, loop.later) for loop in slam.loops if loop.verdict == "used"]
    assert sorted(found) == sorted(used) and len(found) > 0
    assert all(0 < loop.weight <= 1 for loop in slam.loops if loop.verdict == "used")
    with pytest.raises(gyre.Error, match="no scan comes after"):
        slam.add(odometry.register(gyre.open(data, config)[0]), odometry.points)


def test_points_that_are_none_are_refused() -> None:
    slam, odometry = gyre.Slam(gyre.Config({"slam": {"kind": "graph"}})), gyre.Odometry()
    power = np.random.default_rng(1).integers(0, 90, (400, 576), dtype=np.uint8)
    scan = gyre.Scan(power, stamp_ns=0, sweep_s=0.25, range_resolution_m=0.175, clockwise=True)
    registered = odometry.register(scan)
    wrong: list[Any] = [None, [], np.zeros(5, np.float32), np.zeros((3, 5), np.float32), odometry.points[None]]
    for points in wrong:
        with pytest.raises(TypeError, match="Odometry.points"):
            slam.add(registered, points)
    spoilt = odometry.points.copy()
    spoilt["x_m"][3] = np.nan
    with pytest.raises(gyre.ScanError, match="point 3"):
        slam.add(registered, spoilt)
    with pytest.raises(gyre.ScanError, match="capacity"):
        slam.add(registered, np.resize(odometry.points, 9000))
    misaligned = np.frombuffer(b"\0" + odometry.points.tobytes(), odometry.points.dtype, offset=1)
    assert slam.add(registered, misaligned) is True
    assert slam.add(registered, odometry.points[::2]) is False
    assert slam.loops == [] and len(slam.trajectory) == 2


def test_odometry_alone_closes_no_loops() -> None:
    with pytest.raises(gyre.ConfigError, match="slam.kind is none"):
        gyre.Slam(gyre.Config())
