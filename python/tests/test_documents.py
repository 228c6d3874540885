"""The blocks of the guides, and the examples."""

import json
import re
import runpy
import shutil
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
    (tmp_path / "own").mkdir()  # of an earlier execution
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


def test_a_message_for_a_filter_is_of_the_middle_of_its_interval(around: Path) -> None:
    message = runpy.run_path(str(ROOT / "examples/python-robot-localization.py"))["message"]
    config = gyre.Config.of(around)
    odometry = gyre.Odometry(config)
    drive = [odometry.register(scan) for scan in gyre.open(around, config)]
    assert max(abs(registered.motion.yaw_rad) for registered in drive) > 0.1
    for before, after in zip(drive, drive[1:], strict=False):
        published = message(after)
        stamp, pose = published["header"]["stamp"], published["pose"]["pose"]
        assert 0 <= 2 * (stamp["sec"] * 10**9 + stamp["nanosec"]) - before.stamp_ns - after.stamp_ns <= 1
        # The middle of the chord is off the arc by an eighth of the length times the angle.
        position = np.array([pose["position"]["x"], pose["position"]["y"]])
        middle = [(before.pose.x_m + after.pose.x_m) / 2, (before.pose.y_m + after.pose.y_m) / 2]
        length_m = np.hypot(after.motion.x_m, after.motion.y_m)
        assert np.hypot(*(position - middle)) <= length_m * abs(after.motion.yaw_rad) / 4 + 1e-6
        yaw_rad = 2 * np.arctan2(pose["orientation"]["z"], pose["orientation"]["w"])
        turned = yaw_rad - before.pose.yaw_rad - after.motion.yaw_rad / 2
        assert abs(np.angle(np.exp(1j * turned))) < 1e-6


def test_the_example_of_an_external_filter_ends_before_a_gap(around: Path, tmp_path: Path) -> None:
    data = tmp_path / "gap"
    shutil.copytree(around, data)
    for file in gyre.open(data).files[12:63]:
        file.unlink()
    config = ROOT / "configs/simulated-oxford.toml"
    registered = [it.outcome for it in map(gyre.Odometry(gyre.Config.read(config)).register, gyre.open(data))]
    assert len(registered) == 13 and registered[-1] == "start"
    done = python("-W", "error", ROOT / "examples/python-robot-localization.py", data, config)
    assert done.returncode == 0, done.stderr
    assert re.search(r"\bnan\b", done.stdout, re.IGNORECASE) is None


def test_the_settings_of_the_filter_take_the_velocities_alone() -> None:
    settings = (ROOT / "examples/robot_localization.yaml").read_text()
    for sensor, taken in (("odom0", [6, 7, 11]), ("odom1", [6]), ("imu0", [11])):
        flags = re.search(rf"{sensor}_config: \[(.*?)\]", settings, re.DOTALL)
        assert flags is not None
        values = re.findall(r"\b(true|false)\b", flags[1])
        assert len(values) == 15 and [index for index, value in enumerate(values) if value == "true"] == taken
