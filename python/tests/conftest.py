"""The recordings that the tests read, and the program that the package is compared with."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import gyre
import numpy as np
import pytest

STAMP_NS = 1_700_000_000_000_000_000
ROOT = Path(__file__).parent.parent.parent
PROGRAM = Path(os.environ.get("GYRE_PROGRAM") or Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug/gyre")


def gyre_program(*arguments: object) -> str:
    """Runs the program `gyre`, and returns what it prints."""
    if not PROGRAM.is_file():
        pytest.skip(f"there is no {PROGRAM}: build it, or name another by GYRE_PROGRAM")
    done = subprocess.run([str(PROGRAM), *map(str, arguments)], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def python(*arguments: object, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    """Runs Python as a program of its own."""
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, env=os.environ | environment, capture_output=True, text=True)


def scan(power: Any, **changed: Any) -> gyre.Scan:
    """A scan of an array, at a time at which nothing special happens."""
    keywords = {"stamp_ns": STAMP_NS, "sweep_s": 0.25, "range_resolution_m": 0.175, "clockwise": True}
    return gyre.Scan(power, **(keywords | changed))


def noise(azimuths: int = 400, bins: int = 576) -> Any:
    """Powers without a meaning."""
    return np.random.default_rng(1).integers(0, 90, (azimuths, bins), dtype=np.uint8)


@pytest.fixture(scope="session")
def around(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated recording of 64 scans that comes back to its start."""
    out = tmp_path_factory.mktemp("around") / "recording"
    gyre_program("simulate", "configs/demo.toml", "--out", out)
    return out


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated recording of 24 scans."""
    out = tmp_path_factory.mktemp("simulated") / "recording"
    gyre_program("simulate", "configs/demo.toml", "--set", "simulation.scans=24", "--out", out)
    return out


@pytest.fixture(scope="session")
def radiate() -> Path:
    """The real drive of RADIATE."""
    folder = Path(os.environ.get("GYRE_DATA", "")) / "radiate-2019-02-12"
    if not os.environ.get("GYRE_DATA") or not folder.is_dir():
        pytest.skip("there are no real scans: GYRE_DATA names no folder with radiate-2019-02-12")
    return folder
