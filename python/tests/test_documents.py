"""The blocks of the guides, and the examples."""

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


def test_the_guide_runs_and_its_motions_are_those_of_a_run(around: Path, tmp_path: Path) -> None:
    (tmp_path / "recording").symlink_to(around)
    (tmp_path / "models").symlink_to(ROOT / "models")
    (tmp_path / "own").mkdir()  # of an earlier execution
    done = python("-c", blocks("python.md"), cwd=tmp_path, MPLBACKEND="agg")
    assert done.returncode == 0, done.stderr
    assert "64 of 64 scans" in done.stdout and "with loops" in done.stdout
    assert (tmp_path / "scan.png").stat().st_size > 10_000
    gyre_program("run", around, "--out", tmp_path / "run")
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
