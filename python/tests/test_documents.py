"""The blocks of the guides, and the examples."""

import json
import re
from pathlib import Path

import gyre
import numpy as np
from conftest import ROOT, gyre_program, python


def blocks(guide: str) -> str:
    """The blocks of a guide, one after the other."""
    found: list[str] = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / guide).read_text(), re.DOTALL)
    assert len(found) >= 3
    return "\n".join(found)


def test_the_blocks_of_the_guide_run(recording: Path, tmp_path: Path) -> None:
    (tmp_path / "recording").symlink_to(recording)
    done = python("-c", blocks("python.md"), cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_the_tutorial_runs_and_its_motions_are_those_of_a_run(around: Path, tmp_path: Path) -> None:
    (tmp_path / "recording").symlink_to(around)
    (tmp_path / "models").symlink_to(ROOT / "models")
    done = python("-c", blocks("python-tutorial.md"), cwd=tmp_path, MPLBACKEND="agg")
    assert done.returncode == 0, done.stderr
    assert "64 of 64 scans" in done.stdout and "with loops" in done.stdout
    assert (tmp_path / "scan.png").stat().st_size > 10_000
    gyre_program("run", "--data", around, "--out", tmp_path / "run")
    of_run = [row.split(",") for row in (tmp_path / "run/odometry.csv").read_text().splitlines()[1:]]
    columns = [*range(3, 14), 24]
    expected = [",".join(row[column] for column in columns) for row in of_run]
    assert (tmp_path / "motions.csv").read_text().splitlines() == expected


def test_the_example_of_an_own_sensor_drives_two_metres_in_each_sweep() -> None:
    done = python(ROOT / "examples/python-own-sensor.py")
    assert done.returncode == 0, done.stderr
    last = done.stdout.splitlines()[-1]
    assert last.startswith("19 refined")
    x_m, y_m = (float(re.search(rf"{key}=([-\d.]+)", last)[1]) for key in ("x_m", "y_m"))  # type: ignore[index]
    assert abs(x_m - 38) < 0.3 and abs(y_m) < 0.3


def test_the_example_of_an_own_dataset_registers_its_files(recording: Path, tmp_path: Path) -> None:
    for scan in gyre.open(recording).scans(0, 12):
        scan.power[:, ::4][:, :576].tofile(tmp_path / f"{scan.stamp_ns}.u8")
    done = python(ROOT / "examples/python-own-dataset.py", tmp_path, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    truth_file = gyre.find_ground_truth(recording)
    assert truth_file is not None
    evaluation = gyre.evaluate(gyre.Trajectory.read(tmp_path / "trajectory.tum"), gyre.Trajectory.read(truth_file))
    assert evaluation.path_m > 20 and evaluation.ate_m < 0.5


def test_the_example_of_an_external_filter_publishes_and_fuses(around: Path) -> None:
    done = python(ROOT / "examples/python-robot-localization.py", around, ROOT / "configs/simulated-oxford.toml")
    assert done.returncode == 0, done.stderr
    printed, end = json.JSONDecoder().raw_decode(done.stdout)
    assert (printed["header"]["frame_id"], printed["child_frame_id"]) == ("odom", "radar")
    for part in ("pose", "twist"):
        covariance = np.reshape(printed[part]["covariance"], (6, 6))
        assert np.array_equal(covariance, covariance.T) and np.linalg.eigvalsh(covariance).min() > 0
        assert np.all(np.diag(covariance)[[0, 1, 5]] < 1) and np.all(np.diag(covariance)[[2, 3, 4]] == 1e6)
    off = {name: float(metres) for name, metres in re.findall(r"(.+): ([\d.]+) m and .* off at the end", done.stdout[end:])}
    assert set(off) == {"wheels and gyro", "radar", "fused"}
    assert off["fused"] < 0.5 and off["wheels and gyro"] > 4 * off["fused"]


def test_the_settings_of_the_filter_take_the_velocities_alone() -> None:
    settings = (ROOT / "examples/robot_localization.yaml").read_text()
    for sensor, taken in (("odom0", [6, 7, 11]), ("odom1", [6]), ("imu0", [11])):
        flags = re.search(rf"{sensor}_config: \[(.*?)\]", settings, re.DOTALL)
        assert flags is not None
        values = re.findall(r"\b(true|false)\b", flags[1])
        assert len(values) == 15 and [index for index, value in enumerate(values) if value == "true"] == taken
