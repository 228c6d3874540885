"""`python -m gyre.boreas` against pyboreas, the judge of Boreas and Boreas-RT."""

import json
import os
import runpy
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gyre
import numpy as np
import pytest
from conftest import gyre_program
from gyre.boreas import BOREAS_MAP, LOCALISATION, ODOMETRY, Drive, main
from numpy.typing import NDArray
from pyboreas.data import splits  # type: ignore[import-untyped]
from pyboreas.eval.localization import eval_local  # type: ignore[import-untyped]
from pyboreas.eval.odometry import eval_odom  # type: ignore[import-untyped]

Poses = NDArray[np.float64]
START_US, PERIOD_US = 1_606_417_097_528_152, 250_000
NAME = "2021-09-08-21-00"
POSES_HEADER = "scan,stamp_ns,x_m,y_m,yaw_rad"
FIXES_HEADER = f"{POSES_HEADER.replace(',x_m', ',status,x_m')},cov_xx,cov_xy,cov_xyaw,cov_yy,cov_yyaw,cov_yawyaw,correlation,place"
TRUTH_HEADER = "GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading,angvel_z,angvel_y,angvel_x"


@pytest.fixture(autouse=True)
def without_plots(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pyboreas.utils.odometry.plot_stats", lambda *_: None)


def winding(count: int = 600) -> Poses:
    """A path of 1.93 m a scan: no segment ends between two scans by rounding."""
    yaw = 0.9 * np.sin(np.arange(count) / 37) + np.arange(count) / 150
    steps = 1.93 * np.column_stack([np.cos(yaw), np.sin(yaw)])
    return np.column_stack([np.cumsum(steps, axis=0) - steps[0], yaw - yaw[0]])


def real(name: str) -> Poses:
    """A part of a real drive of Boreas, 2 km."""
    file = Path(os.environ.get("GYRE_DATA", "")) / name
    if not os.environ.get("GYRE_DATA") or not file.is_file():
        pytest.skip(f"there is no real drive: GYRE_DATA names no folder with {name}")
    return gyre.Trajectory.read(file).poses[400:1300]


def stamps_us(count: int) -> list[int]:
    return [START_US + PERIOD_US * scan for scan in range(count)]


def write_run(batch: Path, poses: Poses, name: str = NAME) -> Path:
    """A complete run of a batch with these poses, and the names of its images."""
    data, run = batch.parent / f"recordings/boreas-{name}", batch / f"drives/boreas-{name}"
    for folder in (data / "radar", run / "journal", batch / "rows"):
        folder.mkdir(parents=True, exist_ok=True)
    for stamp_us in stamps_us(len(poses)):
        (data / f"radar/{stamp_us}.png").touch()
    stamped = enumerate(zip(stamps_us(len(poses)), poses.tolist(), strict=True))
    rows = [f"{scan},{1000 * stamp_us},{x!r},{y!r},{yaw!r}" for scan, (stamp_us, (x, y, yaw)) in stamped]
    (run / "poses.csv").write_text("\n".join([POSES_HEADER, *rows]) + "\n")
    summary = {"data": str(data), "scans_per_s": 50.0, "machine": {"processor": "CPU", "cores": 2}, "breaks": 0}
    (run / "summary.json").write_text(json.dumps(summary))
    (run / "journal/complete").touch()
    (batch / f"rows/boreas-{name}.json").write_text(json.dumps({"outcome": "complete", "sentence": ""}))
    return run


def write_truth(folder: Path, poses: Poses, name: str = NAME) -> None:
    """The ground truth of a drive, as Boreas has it."""
    applanix, calib = folder / f"boreas-{name}/applanix", folder / f"boreas-{name}/calib"
    applanix.mkdir(parents=True)
    calib.mkdir()
    rows = [
        f"{stamp_us},{x!r},{y!r},0,0,0,0,{np.pi!r},0,{yaw!r},0,0,0"
        for stamp_us, (x, y, yaw) in zip(stamps_us(len(poses)), poses.tolist(), strict=True)
    ]
    (applanix / "radar_poses.csv").write_text("\n".join([TRUTH_HEADER, *rows]) + "\n")
    for file in ("T_applanix_lidar", "T_radar_lidar"):
        np.savetxt(calib / f"{file}.txt", np.eye(4))


def judged(tmp_path: Path, poses: Poses, truth: Poses) -> tuple[float, float]:
    """What pyboreas says of the odometry: % and deg/m."""
    shutil.rmtree(tmp_path, ignore_errors=True)
    write_run(tmp_path / "batch", poses)
    write_truth(tmp_path / "truth", truth)
    (tmp_path / "written").mkdir()
    (tmp_path / f"written/boreas-{NAME}.txt").write_text(Drive(tmp_path / "batch", NAME).odometry())
    translation, rotation = eval_odom(str(tmp_path / "written"), str(tmp_path / "truth"), radar=True)
    return float(translation), float(rotation)


def composed(poses: Poses, motions: Poses) -> Poses:
    """Poses, each moved by a motion in its own frame."""
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    x = poses[:, 0] + cos * motions[:, 0] - sin * motions[:, 1]
    y = poses[:, 1] + sin * motions[:, 0] + cos * motions[:, 1]
    return np.column_stack([x, y, poses[:, 2] + motions[:, 2]])


@pytest.mark.parametrize("drive", ["", "cases/boreas-truth/gps_poses.csv", "trajectories/boreas-2020-11-26.tum"])
def test_the_truth_as_our_poses_is_without_error_and_a_scale_is_an_error(drive: str, tmp_path: Path) -> None:
    truth = real(drive) if drive else winding()
    # A run begins at its own origin.
    origin = composed(np.zeros((1, 3)), truth[:1])[0]
    cos, sin = np.cos(-origin[2]), np.sin(-origin[2])
    apart = truth - origin
    ours = np.column_stack([cos * apart[:, 0] - sin * apart[:, 1], sin * apart[:, 0] + cos * apart[:, 1], apart[:, 2]])
    assert judged(tmp_path / "same", ours, truth) == pytest.approx((0, 0), abs=1e-5)
    # A hundredth of the displacement, which is less than the path.
    scaled, stamps_ns = ours * [1.01, 1.01, 1.0], 1000 * np.array(stamps_us(len(truth)))
    expected = gyre.evaluate(gyre.Trajectory(stamps_ns, scaled), gyre.Trajectory(stamps_ns, truth), step=4).translation_percent
    assert expected is not None and 0.7 < expected < 1.0
    assert judged(tmp_path / "scaled", scaled, truth) == pytest.approx((expected, 0), abs=1e-5)


def test_a_scale_of_a_hundredth_on_a_straight_road_is_one_percent(tmp_path: Path) -> None:
    truth = np.column_stack([1.93 * np.arange(450), np.zeros((450, 2))])
    # Segments end behind their length, at the next scan.
    assert judged(tmp_path, truth * [1.01, 1, 1], truth) == pytest.approx((1.0, 0), abs=0.01)


@pytest.mark.parametrize("drive", ["", "cases/boreas-truth/gps_poses.csv"])
def test_figures_are_those_of_gyre_evaluate(drive: str, tmp_path: Path) -> None:
    truth = real(drive) if drive else winding()
    along = np.arange(len(truth))[:, None]
    random = np.random.default_rng(3)
    drift = np.cumsum(random.normal(0, [0.02, 0.02, 2e-4], truth.shape), axis=0) + along * [1e-3, 0, 1e-6]
    estimate = composed(truth, drift)
    translation, rotation = judged(tmp_path, estimate, truth)
    stamps_ns = 1000 * np.array(stamps_us(len(truth)))
    ours = gyre.evaluate(gyre.Trajectory(stamps_ns, estimate), gyre.Trajectory(stamps_ns, truth), step=4)
    assert translation == pytest.approx(ours.translation_percent, rel=1e-4)
    assert 100 * rotation == pytest.approx(ours.rotation_deg_per_100m, rel=1e-4)
    # Gyre reads the file too.
    again = gyre.Trajectory.read(tmp_path / f"written/boreas-{NAME}.txt")
    read = gyre.evaluate(again, gyre.Trajectory(stamps_ns, truth), step=4)
    assert read.translation_percent == pytest.approx(ours.translation_percent, rel=1e-6)


def write_localised(tmp_path: Path, count: int, noise: Callable[[int], Poses], covariance: Poses) -> Path:
    """A drive beside the path of its map, localised with errors, and the truth of both."""
    batch, path = tmp_path / "batch", winding(count)
    drive = composed(path, np.tile([0.7, -1.5, 0.1], (count, 1)))
    run = write_run(batch, path, BOREAS_MAP)
    gyre.Trajectory(1000 * np.array(stamps_us(count)), path).write_tum(run / "trajectory_slam.tum")
    write_run(batch, drive)
    write_truth(tmp_path / "truth", composed(np.tile([600.0, 400.0, 0.8], (count, 1)), path), BOREAS_MAP)
    write_truth(tmp_path / "truth", composed(np.tile([600.0, 400.0, 0.8], (count, 1)), drive))
    found = drive + noise(count)
    upper = ",".join(map(repr, covariance[np.triu_indices(3)].tolist()))
    rows = [
        # Not the nearest scan of the map: a lever of 12 m.
        f"{scan},{1000 * stamp_us},tracked,{x!r},{y!r},{yaw!r},{upper},0.9,{scan - 6 if scan >= 6 else scan}"
        for scan, (stamp_us, (x, y, yaw)) in enumerate(zip(stamps_us(count), found.tolist(), strict=True))
    ]
    fixes = batch / f"localised/boreas-{NAME}/fixes.csv"
    fixes.parent.mkdir(parents=True)
    fixes.write_text("\n".join([FIXES_HEADER, *rows]) + "\n")
    return batch


def localised(tmp_path: Path, batch: Path) -> NDArray[np.float64]:
    """What pyboreas says of the localisation: RMSE lateral, longitudinal, vertical, of roll, pitch and heading; consistency."""
    reference = Drive(batch, BOREAS_MAP)
    text = Drive(batch, NAME).localisation(batch, reference, reference.corrected())
    (tmp_path / "written").mkdir()
    (tmp_path / f"written/boreas-{NAME}.txt").write_text(text)
    errors, _ = eval_local(str(tmp_path / "written"), str(tmp_path / "truth"), f"boreas-{BOREAS_MAP}", "radar", "radar", dim=2)
    figures: NDArray[np.float64] = errors[0]
    return figures


def test_the_true_place_in_a_map_is_without_error(tmp_path: Path) -> None:
    batch = write_localised(tmp_path, 60, lambda count: np.zeros((count, 3)), np.diag([0.01, 0.01, 1e-6]))
    assert localised(tmp_path, batch)[:6] == pytest.approx(np.zeros(6), abs=1e-5)


def test_the_consistency_of_right_covariances_is_that_of_three_of_six(tmp_path: Path) -> None:
    # Along the axes of the map, so that wrong axes and a wrong lever would show.
    covariance = np.array([[0.04, 0.01, 1e-3], [0.01, 0.01, 5e-4], [1e-3, 5e-4, 4e-4]])
    random = np.random.default_rng(5)
    batch = write_localised(tmp_path, 600, lambda count: random.multivariate_normal(np.zeros(3), covariance, count), covariance)
    figures = localised(tmp_path, batch)
    assert figures[6] == pytest.approx(np.sqrt(3 / 6), rel=0.04)
    assert figures[5] == pytest.approx(np.degrees(0.02), rel=0.1)


def spoil(file: Path, change: Callable[[list[str]], list[str]]) -> None:
    file.write_text("\n".join(change(file.read_text().splitlines())) + "\n")


def without(*lines: int) -> Callable[[list[str]], list[str]]:
    return lambda rows: [row for number, row in enumerate(rows) if number not in lines]


def edit(file: Path, **changed: object) -> None:
    file.write_text(json.dumps(json.loads(file.read_text()) | changed))


POSES, SUMMARY, ROW = f"drives/boreas-{NAME}/poses.csv", f"drives/boreas-{NAME}/summary.json", f"rows/boreas-{NAME}.json"
FIXES = f"localised/boreas-{NAME}/fixes.csv"
FIRST, MIDDLE = f"the first is {START_US}.png", f"the first is {START_US + 4 * PERIOD_US}.png"


def unsure_again(batch: Path) -> None:
    edit(batch / ROW, outcome="unsure")
    (batch / f"drives/boreas-{NAME}/journal/complete").unlink()


TRAPS: dict[str, tuple[Callable[[Path], Any], str]] = {
    "a missing drive": (lambda batch: (batch / ROW).unlink(), f"lacks 1 of the 13 drives of the odometry of boreas, which needs all: boreas-{NAME}"),
    "a skipped first scan": (lambda batch: spoil(batch / POSES, without(1)), f"poses.csv has no pose for 1 of the 9 images of the radar, {FIRST}"),
    "a skipped last scan": (lambda batch: spoil(batch / POSES, without(9)), "poses.csv has no pose for 1 of the 9 images"),
    "scans that cannot be read": (lambda batch: spoil(batch / POSES, without(5, 6)), f"for 2 of the 9 images of the radar, {MIDDLE}"),
    "another recording": (lambda batch: spoil(batch / POSES, lambda rows: [row.replace("1606417", "1606418") for row in rows]), "is not of an image"),
    "a damaged table": (lambda batch: spoil(batch / POSES, lambda rows: [row.replace("yaw_rad", "yaw") for row in rows]), "is damaged"),
    "no images": (lambda batch: shutil.rmtree(batch.parent / f"recordings/boreas-{NAME}"), "there are no images of the radar in"),
    "a run that failed": (lambda batch: edit(batch / ROW, outcome="failed", sentence="a full disk"), "is not complete (failed: a full disk)"),
    "a run that runs again": (lambda batch: (batch / f"drives/boreas-{NAME}/journal/complete").unlink(), "is being computed again"),
    "a gap": (lambda batch: edit(batch / SUMMARY, breaks=2), "has 2 gaps of more than 10 s"),
    "wheels": (lambda batch: edit(batch / SUMMARY, wheels={"motions": 3}), "used wheels, and the benchmark has names for"),
    "a damaged summary": (lambda batch: (batch / SUMMARY).write_text("{"), "is damaged"),
    "a drive that is not localised": (lambda batch: (batch / FIXES).unlink(), "fixes.csv: No such file or directory; `gyre localise"),
    "lost scans": (lambda batch: spoil(batch / FIXES, lambda rows: [*rows[:1], f"0,{1000 * START_US},lost{',' * 11}", *rows[2:]]), f"fixes.csv has no pose for 1 of the 9 images of the radar, {FIRST}"),
    "another map": (lambda batch: spoil(batch / FIXES, lambda rows: [*rows[:-1], rows[-1][:-1] + "77"]), "is not near scan 77 of"),
    "a far place": (lambda batch: spoil(batch / FIXES, lambda rows: [row.replace("tracked,", "tracked,1") for row in rows]), "localise in the map"),
    "no covariance": (lambda batch: spoil(batch / FIXES, lambda rows: [row.replace(",0.01", ",0.0") for row in rows]), "is not positive definite"),
    "an unsure run that runs again": (unsure_again, "is being computed again"),
    "a map without loops": (lambda batch: (batch / f"drives/boreas-{BOREAS_MAP}/trajectory_slam.tum").unlink(), "slam.kind=graph"),
    "no map": (lambda batch: (batch / f"rows/boreas-{BOREAS_MAP}.json").unlink(), "lacks 1 of the 1 drives of the maps of boreas"),
}  # fmt: skip


def whole(tmp_path: Path) -> Path:
    """A batch of all drives of Boreas and one that is not listed, all localised."""
    batch = write_localised(tmp_path, 9, lambda count: np.zeros((count, 3)), np.diag([0.01, 0.01, 1e-6]))
    for name in ODOMETRY["boreas"]:
        write_run(batch, winding(9), name)
    for name in LOCALISATION["boreas"]:
        (batch / f"localised/boreas-{name}").mkdir(exist_ok=True)
        if name != NAME:
            shutil.copy(batch / FIXES, batch / f"localised/boreas-{name}/fixes.csv")
    write_run(batch, winding(9), "2021-05-13-16-11")
    return batch


def command(batch: Path, benchmark: str = "boreas", *more: str) -> int:
    return main([str(batch), "--benchmark", benchmark, "--method", "gyre", "--email", "a@b.org", "--out", str(batch.parent / "zips"), *more])


@pytest.mark.parametrize("trap", TRAPS)
def test_a_trap_is_an_error_and_leaves_no_file(trap: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    batch, (set_trap, sentence) = whole(tmp_path), TRAPS[trap]
    set_trap(batch)
    assert command(batch) == 1
    said = capsys.readouterr().err
    assert said.startswith("error: ") and said.count("\n") == 1 and sentence in said, said
    assert not (tmp_path / "zips").exists()


def test_values_that_the_benchmark_refuses_are_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    batch = whole(tmp_path)
    for arguments, sentence in (
        (["--author", "A" * 101], "author has 101 characters, and the benchmark accepts 100"),
        (["--method", "m" * 31], "methodname has 31 characters"),
        (["--method", "a/b"], "--method a/b: the name is part of that of a file"),
    ):
        assert command(batch, "boreas", *arguments) == 1
        assert sentence in capsys.readouterr().err
    assert not (tmp_path / "zips").exists()


def test_the_drives_are_those_of_the_judge() -> None:
    def names(split: list[list[str]]) -> list[str]:
        return [name.removeprefix("boreas-") for (name,) in split]

    assert ODOMETRY == {"boreas": names(splits.odom_test), "boreasrt": names(splits.odom_test_rt)}
    assert [*LOCALISATION["boreas"]] == names(splits.loc_test)
    assert [*LOCALISATION["boreasrt"]] == names(splits.loc_test_rt)
    assert f"boreas-{BOREAS_MAP}" == splits.loc_reference


def test_an_unsure_run_is_written_with_a_warning_and_other_drives_are_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    batch = whole(tmp_path)
    edit(batch / ROW, outcome="unsure", sentence="9 predicted motions of 9")
    edit(batch / SUMMARY, gyro={"motions": 3})
    assert command(batch, "boreas", "--author", "Ö. Ä: #1") == 0
    assert capsys.readouterr().err == f"warning: boreas-{NAME} is unsure: 9 predicted motions of 9\n"
    with zipfile.ZipFile(tmp_path / "zips/boreas-gyre-odometry.zip") as archive:
        assert len(archive.namelist()) == 14 and not any("2021-05-13" in name for name in archive.namelist())
        assert 'sensors: ["radar", "IMU"]' in archive.read("metadata.yaml").decode()
        rows = [row.split() for row in archive.read(f"boreas-{NAME}.txt").decode().splitlines()]
    assert [int(row[0]) for row in rows] == stamps_us(9)
    assert all(len(row) == 13 and float(row[1]) ** 2 + float(row[2]) ** 2 == pytest.approx(1) for row in rows)


def test_the_judge_accepts_batches_of_all_drives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One drive by `gyre batch`, `gyre map` and `gyre localise`, under the names of all."""
    monkeypatch.chdir(tmp_path)
    batch, data = tmp_path / "batch", tmp_path / "data/drive"
    path = np.column_stack([2.0 * np.arange(20), np.zeros((20, 2))])
    gyre.Trajectory(1000 * np.array(stamps_us(20)), path).write_tum(tmp_path / "path.tum")
    gyre_program("simulate", "--trajectory", tmp_path / "path.tum", "--format", "boreas", "--scans", 12, "--out", data)
    gyre_program("batch", tmp_path / "data", "--out", batch, "--set", "slam.kind=graph")
    gyre_program("map", batch / "drives/drive", "--format", "folder", "--out", tmp_path / "map")
    gyre_program("localise", "--map", tmp_path / "map", data, "--out", batch / "localised/drive")
    for name in [*sum(ODOMETRY.values(), []), BOREAS_MAP]:
        shutil.copy(batch / "rows/drive.json", batch / f"rows/boreas-{name}.json")
        for folder in ("drives", "localised"):
            (batch / f"{folder}/boreas-{name}").symlink_to(batch / folder / "drive")
    for benchmark in ODOMETRY:
        assert command(batch, benchmark) == 0
        for kind in ("odometry", "localization"):
            file = tmp_path / f"zips/{benchmark}-gyre-{kind}.zip"
            monkeypatch.setattr("sys.argv", ["submission_checker", "--file", str(file)])
            runpy.run_module("pyboreas.eval.submission_checker", run_name="__main__")
            assert "Submission checker PASSED" in capsys.readouterr().out
