"""The package finds what the processes of a run find."""

import csv
from pathlib import Path

import gyre
import numpy as np
import pytest
from conftest import ROOT, gyre_program

COVARIANCE = ["cov_xx", "cov_xy", "cov_xyaw", "cov_yy", "cov_yyaw", "cov_yawyaw"]


def motions_of_run(out: Path) -> list[list[str]]:
    with open(out / "odometry.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    columns = ["stamp_ns", "interval_ns", "x_m", "y_m", "yaw_rad", *COVARIANCE]
    return [[row[column] for column in [*columns, "outcome", "stationary"]] for row in rows]


def row(registered: gyre.Registered) -> list[str]:
    motion = registered.motion
    covariance = motion.covariance[np.triu_indices(3)]
    return [
        str(registered.stamp_ns),
        str(registered.interval_ns),
        *(f"{value:.9f}" for value in (motion.x_m, motion.y_m, motion.yaw_rad)),
        *(f"{value:.12f}" for value in covariance),
        registered.outcome,
        str(int(registered.stationary)),
    ]


def assert_same(config: gyre.Config, data: Path, out: Path, scans: int) -> None:
    odometry = gyre.Odometry(config)
    registered = []
    for scan in gyre.open(data, config):
        registered.append(odometry.register(scan))
        if len(registered) == scans:
            break
    assert [row(it) for it in registered if it.outcome != "start"] == motions_of_run(out)
    odometry.trajectory.write_tum(out / "trajectory_python.tum")
    assert (out / "trajectory_python.tum").read_bytes() == (out / "trajectory.tum").read_bytes()


def test_motions_of_a_simulated_recording_are_those_of_a_run(recording: Path, tmp_path: Path) -> None:
    gyre_program("run", recording, "--out", tmp_path)
    assert_same(gyre.Config.of(recording), recording, tmp_path, 24)


def test_motions_of_real_scans_are_those_of_a_run(radiate: Path, tmp_path: Path) -> None:
    gyre_program("run", radiate, "--out", tmp_path, "--set", "source.scans=100")
    assert_same(gyre.Config.of(radiate), radiate, tmp_path, 100)


def test_motions_with_a_gyro_are_those_of_a_run(radiate: Path, tmp_path: Path) -> None:
    gyro = {"gyro.kind": "auto", "gyro.delay_s": 1.58, "gyro.up": "-z"}
    given = [argument for key, value in gyro.items() for argument in ("--set", f"{key}={value}")]
    gyre_program("run", radiate, "--out", tmp_path, "--set", "source.scans=40", *given)
    config = gyre.Config.read(tmp_path / "config.toml")
    assert_same(config, radiate, tmp_path, 40)
    for scan in gyre.open(radiate, config).scans(4, 8):
        stamps = np.array([stamp_ns for stamp_ns, _ in scan.gyro])
        assert len(stamps) >= 8 and np.diff(stamps).min() > 0
        assert stamps.max() <= scan.azimuth_stamp_ns.max() < stamps.max() + 100_000_000


def test_a_learned_mask_is_that_of_a_run(recording: Path, tmp_path: Path) -> None:
    overrides: dict[str, object] = {"masking.kind": "learned", "masking.model": ROOT / "models/gyre-255.toml", "masking.backend": "rten"}
    given = [argument for key, value in overrides.items() for argument in ("--set", f"{key}={value}")]
    gyre_program("run", "configs/demo.toml", recording, "--out", tmp_path, "--set", "source.scans=4", *given)
    config = gyre.Config.read(ROOT / "configs/demo.toml", overrides)
    assert_same(config, recording, tmp_path, 4)


def test_the_configuration_is_that_of_a_run(recording: Path, tmp_path: Path) -> None:
    gyre_program("run", recording, "--out", tmp_path, "--set", "source.scans=2")
    assert gyre.Config.read(tmp_path / "config.toml") == gyre.Config.of(recording)


def test_a_report_is_that_of_the_program(recording: Path) -> None:
    assert str(gyre.inspect(recording)).strip() == gyre_program("inspect", recording).strip()


def test_an_evaluation_is_that_of_the_program(recording: Path, tmp_path: Path) -> None:
    config = gyre.Config.of(recording)
    odometry = gyre.Odometry(config)
    for scan in gyre.open(recording, config):
        odometry.register(scan)
    odometry.trajectory.write_tum(tmp_path / "trajectory.tum")
    truth = gyre.find_ground_truth(recording)
    assert truth is not None
    printed = gyre_program("evaluate", tmp_path / "trajectory.tum", truth)
    estimate = gyre.Trajectory.read(tmp_path / "trajectory.tum")
    assert str(gyre.evaluate(estimate, gyre.Trajectory.read(truth))).strip() in printed
    with pytest.raises(ValueError, match="step is 0"):
        gyre.evaluate(estimate, estimate, step=0)
