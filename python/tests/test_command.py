"""The command `gyre-odometry`."""

import json
import re
import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import gyre
import gyre.__main__
import pytest
from conftest import gyre_program, python


def command(*arguments: object) -> int:
    return gyre.__main__.main([str(argument) for argument in arguments])


def rows(file: Path) -> list[dict[str, str]]:
    header, *lines = file.read_text().splitlines()
    return [dict(zip(header.split(","), line.split(","), strict=True)) for line in lines]


def test_the_command_writes_draws_and_evaluates(recording: Path, tmp_path: Path) -> None:
    done = python("-m", "gyre", recording, "--out", tmp_path / "out", "--set", "masking.threshold=70", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "24 scans" in done.stdout and "ATE" in done.stdout
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names == {
        "config.toml", "evaluation.json", "odometry.csv", "trajectory.svg", "trajectory.tum", "trajectory_kitti.txt"
    }  # fmt: skip
    assert gyre.Config.read(tmp_path / "out/config.toml").to_dict()["masking"]["threshold"] == 70
    assert len(gyre.Trajectory.read(tmp_path / "out/trajectory.tum")) == 24
    assert len(gyre.Trajectory.read(tmp_path / "out/trajectory_kitti.txt")) == 24
    assert json.loads((tmp_path / "out/evaluation.json").read_text())["ate"]["rmse_m"] < 1


def test_its_motions_are_rows_of_those_of_a_run(recording: Path, tmp_path: Path) -> None:
    gyre_program("run", recording, "--out", tmp_path / "run")
    assert command(recording, "--out", tmp_path / "python") == 0
    of_run, mine = rows(tmp_path / "run/odometry.csv"), rows(tmp_path / "python/odometry.csv")
    assert len(mine) == 23
    assert mine == [{column: row[column] for column in mine[0]} for row in of_run]


def test_its_rows_are_those_of_a_run_behind_a_gap_too(around: Path, tmp_path: Path) -> None:
    data = tmp_path / "gap"
    shutil.copytree(around, data)
    for file in gyre.open(data).files[8:56]:
        file.unlink()
    gyre_program("run", data, "--out", tmp_path / "run")
    assert command(data, "--out", tmp_path / "python") == 0
    of_run, mine = rows(tmp_path / "run/odometry.csv"), rows(tmp_path / "python/odometry.csv")
    assert [int(row["seq"]) for row in mine] == [*range(1, 8), *range(9, 16)]
    assert mine == [{column: row[column] for column in mine[0]} for row in of_run]


def test_loops_are_closed_where_the_configuration_says_so(around: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    gyre_program("run", around, "--out", tmp_path / "run", "--set", "slam.kind=graph")
    assert command(around, "--out", tmp_path / "python", "--set", "slam.kind=graph") == 0
    assert re.search(r"\n[1-9]\d* loops, and the trajectory corrected by them", capsys.readouterr().out)
    for name in ("trajectory.tum", "trajectory_slam.tum"):
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "run" / name).read_bytes()
    assert (tmp_path / "python/trajectory_slam.svg").read_text().startswith("<svg")


def test_a_part_of_a_recording_is_registered(recording: Path, tmp_path: Path) -> None:
    for arguments, scans in ((["-n", 5], range(5)), (["--jump", 20], range(20, 24)), (["-j", 3, "-n", 4], range(3, 7)), (["-n", 99], range(24))):
        assert command(recording, "--out", tmp_path, *arguments) == 0
        assert [int(row["scan"]) for row in rows(tmp_path / "odometry.csv")] == list(scans)[1:]
    assert command(recording, "--out", tmp_path, "-n", 1) == 0
    assert rows(tmp_path / "odometry.csv") == []


def test_no_scan_to_register_is_an_error(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (["-n", 0], ["-j", 24], ["-j", 2**62]):
        assert command(recording, "--out", tmp_path, *arguments) == 1
        assert "there is no scan to register" in capsys.readouterr().err
    for number in ("-1", "many", "1.5", str(2**64)):
        with pytest.raises(SystemExit) as ended:
            command(recording, "-n", number)
        assert ended.value.code == 2


def test_a_drive_without_a_scan_that_can_be_used_is_an_error(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def without_times(scans: Iterator[gyre.Scan], _: int) -> Iterator[gyre.Scan]:
        for scan in scans:
            scan.azimuth_stamp_ns[:] = 0
            yield scan

    monkeypatch.setattr(gyre.__main__, "progress", without_times)
    assert command(recording, "--out", tmp_path / "out", "-n", 3) == 1
    *warnings, error = capsys.readouterr().err.splitlines()
    assert [re.match(r"\r?warning: skipped: scan \d: ", warning) is not None for warning in warnings if warning] == [True] * 3
    assert error == f"error: no scan of {recording} could be registered: the warnings say why"
    assert [file.name for file in (tmp_path / "out").iterdir()] == ["config.toml"]


def test_results_of_another_drive_are_removed_and_not_listed(around: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert command(around, "--out", out, "-n", 8, "--set", "slam.kind=graph") == 0
    names = {file.name for file in out.iterdir()}
    assert len(names) == 10 and {"evaluation.json", "evaluation_slam.json", "trajectory_slam.tum"} < names
    (out / "notes.txt").write_text("mine")
    without_truth = tmp_path / "drive"
    shutil.copytree(around, without_truth)
    while truth := gyre.find_ground_truth(without_truth):
        truth.unlink()
    capsys.readouterr()
    assert command(without_truth, "--out", out, "-n", 2) == 0
    kept = ["config.toml", "odometry.csv", "trajectory.svg", "trajectory.tum", "trajectory_kitti.txt"]
    assert capsys.readouterr().out.splitlines()[-1] == f"results in {out}: {', '.join(kept)}"
    assert sorted(file.name for file in out.iterdir()) == sorted([*kept, "notes.txt"])
    # A call that is refused leaves the results alone.
    assert command(around, "--out", out, "-n", 0) == 1
    assert sorted(file.name for file in out.iterdir()) == sorted([*kept, "notes.txt"])


def test_it_ends_with_a_sentence(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    run = tmp_path / "run"
    (run / "journal").mkdir(parents=True)
    for arguments in (
        [tmp_path / "missing"],
        [tmp_path],
        [recording, "--set", "masking"],
        [recording, "--set", "masking.treshold=3"],
        [recording, "--set", "slam.kind=graph", "--set", "slam.map=map"],
        [recording, "--config", "missing.toml"],
        [recording, "--ground-truth", "missing.tum"],
        [recording, "--out", tmp_path / "file"],
        [recording, "--out", run],
    ):
        assert command("--out", tmp_path / "out", *arguments) == 1
        assert re.fullmatch(r"error: [^\n]+\n", capsys.readouterr().err)


def test_what_was_registered_before_a_file_that_is_gone_is_written(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(recording, copy)

    def removing(scans: Iterator[gyre.Scan], _: int) -> Iterator[gyre.Scan]:
        yield from (next(scans) for _ in range(8))
        gyre.open(copy).files[8].unlink()
        yield from scans

    monkeypatch.setattr(gyre.__main__, "progress", removing)
    assert command(copy, "--out", tmp_path / "out") == 1
    assert re.search(r"error: cannot read .*png: ", capsys.readouterr().err)
    assert len(rows(tmp_path / "out/odometry.csv")) == 7


def test_what_was_registered_before_ctrl_c_is_written(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(scans: Iterator[gyre.Scan], total: int) -> Iterator[gyre.Scan]:
        assert total == 24
        yield from (next(scans) for _ in range(6))
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(gyre.__main__, "progress", interrupted)
    assert command(recording, "--out", tmp_path) == 130
    assert "interrupted" in capsys.readouterr().err
    assert len(gyre.Trajectory.read(tmp_path / "trajectory.tum")) == 6


def test_a_window_follows_the_drive(recording: Path, tmp_path: Path) -> None:
    arguments = (recording, "--out", tmp_path / "out", "-n", 3, "--visualize")
    assert python("-m", "gyre", *arguments, MPLBACKEND="agg").returncode == 0
    without_display = python("-m", "gyre", *arguments, DISPLAY="", WAYLAND_DISPLAY="")
    assert without_display.returncode == 1 and "needs a display" in without_display.stderr


def test_without_matplotlib_a_window_is_refused_with_what_to_install(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    monkeypatch.delitem(sys.modules, "gyre.visualize", raising=False)
    assert command(recording, "--out", tmp_path, "--visualize") == 1
    assert capsys.readouterr().err.splitlines()[-1] == "error: --visualize needs matplotlib: install it, or gyre[visualize]"


def test_values_of_the_command_line_are_numbers_or_strings() -> None:
    changed = gyre.__main__.overrides(["a.b=3", "a.c = 0.5", "a.d=true", "a.e='x y'", "a.f=none"])
    assert changed == {"a.b": 3, "a.c": 0.5, "a.d": True, "a.e": "x y", "a.f": "none"}
