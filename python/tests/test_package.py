"""The command line, the examples and the types."""

import os
import re
import subprocess
import sys
from pathlib import Path

import gyre
import gyre.__main__
import pytest

ROOT = Path(__file__).parents[2]


def python(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *map(str, arguments)], cwd=cwd, capture_output=True, text=True)


def test_the_command_writes_draws_and_evaluates(recording: Path, tmp_path: Path) -> None:
    done = python("-m", "gyre", recording, "--out", tmp_path / "out", "--set", "masking.threshold=70", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "24 of 24 scans" in done.stdout and "ATE" in done.stdout
    names = {file.name for file in (tmp_path / "out").iterdir()}
    assert names == {"config.toml", "trajectory.svg", "trajectory.tum", "trajectory_kitti.txt"}
    assert gyre.Config.read(tmp_path / "out/config.toml").to_dict()["masking"]["threshold"] == 70
    assert len(gyre.Trajectory.read(tmp_path / "out/trajectory.tum")) == 24


def test_the_command_ends_with_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in ([str(tmp_path)], [str(tmp_path), "--set", "masking"], [str(tmp_path), "--config", "missing.toml"]):
        assert gyre.__main__.main(arguments) == 1
        assert re.fullmatch(r"error: .+\n", capsys.readouterr().err)


def test_values_of_the_command_line_are_numbers_or_strings() -> None:
    changed = gyre.__main__.overrides(["a.b=3", "a.c = 0.5", "a.d=true", "a.e='x y'", "a.f=none"])
    assert changed == {"a.b": 3, "a.c": 0.5, "a.d": True, "a.e": "x y", "a.f": "none"}


def test_the_example_of_an_own_sensor_drives_two_metres_in_each_sweep() -> None:
    done = python(ROOT / "examples/python-own-sensor.py")
    assert done.returncode == 0, done.stderr
    last = done.stdout.splitlines()[-1]
    assert last.startswith("19 refined")
    x_m, y_m = (float(re.search(rf"{key}=([-\d.]+)", last)[1]) for key in ("x_m", "y_m"))  # type: ignore[index]
    assert abs(x_m - 38) < 0.3 and abs(y_m) < 0.3


def test_the_blocks_of_the_guide_run(recording: Path, tmp_path: Path) -> None:
    guide = (ROOT / "docs/python.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", guide, re.DOTALL)
    assert len(blocks) >= 3
    (tmp_path / "recording").symlink_to(recording)
    done = python("-c", "\n".join(blocks), cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_all_is_documented() -> None:
    for name in gyre.__all__:
        thing = getattr(gyre, name)
        if name == "__version__":
            continue
        assert thing.__doc__, name
        for member, value in vars(thing).items() if isinstance(thing, type) else ():
            if not member.startswith("_"):
                assert value.__doc__, f"{name}.{member}"


def test_types_are_those_of_the_stubs() -> None:
    folder = ROOT / "python"
    environment = os.environ | {"MYPY_CACHE_DIR": os.devnull}
    example = ROOT / "examples/python-own-sensor.py"
    checks = [
        ["mypy", "--strict", "-p", "gyre"],
        ["mypy", "--strict", "tests", str(example)],
        ["mypy.stubtest", "gyre", "--ignore-disjoint-bases"],
    ]
    for check in checks:
        done = subprocess.run(
            [sys.executable, "-m", *check], cwd=folder, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr
