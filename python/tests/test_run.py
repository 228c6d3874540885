"""Running runs: their messages in shared memory, and their control."""

import csv
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import gyre
import numpy as np
import pytest
from conftest import PROGRAM, ROOT


@pytest.fixture
def out(tmp_path: Path) -> Iterator[Path]:
    """The folder of a run of the demo with moving objects, at four times its speed."""
    if not PROGRAM.is_file():
        pytest.skip(f"there is no {PROGRAM}: build it, or name another by GYRE_PROGRAM")
    out = tmp_path / "out"
    keys = ("slam.kind=graph", "objects.kind=tracks")
    settings = [word for key in keys for word in ("--set", key)]
    command = [PROGRAM, "run", "configs/demo.toml", "--rate", "4", "--out", out, *settings]
    with subprocess.Popen([str(word) for word in command], cwd=ROOT, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as run:
        yield out
        run.terminate()


def attach(out: Path) -> gyre.Run:
    """Attaches to a run that is about to begin."""
    until = time.monotonic() + 60
    while True:
        try:
            return gyre.Run(out)
        except gyre.RunError:
            assert time.monotonic() < until
            time.sleep(0.05)


def test_poses_of_a_run_are_those_of_its_results(out: Path) -> None:
    run = attach(out)
    assert run.out == out
    assert run.topics[0] == "scan"
    poses = {pose.scan: (pose.stamp_ns, pose.motion.x_m, pose.covariance) for pose in run.poses()}
    while not (run.has_ended and (out / "odometry.csv").exists()):
        time.sleep(0.05)
    with open(out / "odometry.csv", newline="") as file:
        rows = {int(row["scan"]): row for row in csv.DictReader(file)}
    assert len(poses.keys() & rows.keys()) > 40
    for scan, (stamp_ns, x_m, covariance) in poses.items():
        if scan in rows:
            assert str(stamp_ns) == rows[scan]["stamp_ns"]
            assert f"{x_m:.9f}" == rows[scan]["x_m"]
        assert covariance.shape == (3, 3)
        assert np.array_equal(covariance, covariance.T)


def test_arrays_are_views_that_the_next_message_needs_released(out: Path) -> None:
    run = attach(out)
    scans = run.scans()
    scan = next(scans)
    assert scan.power.shape == (400, 3768)
    assert len(scan.azimuth_rad) == len(scan.azimuth_stamp_ns) == 400
    power = scan.power
    assert not power.flags.writeable
    with pytest.raises(gyre.RunError, match="still held"):
        next(scans)
    kept = power.copy()
    del power
    later = next(scans)
    assert later.seq > 0
    assert kept.any()
    with pytest.raises(gyre.RunError, match="released"):
        scan.power
    masked = next(run.points())
    assert masked.raster.shape == (masked.n, masked.n)
    assert masked.points.shape == (len(masked.points), 5)
    assert "stamp_ns" in dir(masked)
    with pytest.raises(AttributeError, match="no field `missing`"):
        masked.missing


def test_other_topics_are_read_by_their_names(out: Path) -> None:
    run = attach(out)
    assert next(run.corrections()).keyframes > 0
    objects = next(run.objects())
    assert len(objects.list) == objects.listed
    assert next(run.observe("rotation")).to_dict()["rotation"].keys() >= {"angle_rad", "score"}
    for topic, sentence in (("missing", "there is no topic"), ("fix", "only a run with a map")):
        with pytest.raises(gyre.RunError, match=sentence):
            run.observe(topic)


def test_a_run_is_controlled(out: Path) -> None:
    run = attach(out)
    next(run.poses())
    assert run.status()["processes"][0]["name"] == "radar-replay"
    run.restart("masking")
    with pytest.raises(gyre.RunError, match="missing"):
        run.restart("missing")
    run.down()
    list(run.poses())
    with pytest.raises(gyre.RunError, match="no run is writing"):
        while True:
            gyre.Run(out)
