"""The recordings that the tests read, and the program that the package is compared with."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
PROGRAM = Path(os.environ.get("GYRE_PROGRAM") or Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "debug/gyre")


def gyre_program(*arguments: object) -> str:
    """Runs the program `gyre`, and returns what it prints."""
    if not PROGRAM.is_file():
        pytest.skip(f"there is no {PROGRAM}: build it, or name another by GYRE_PROGRAM")
    done = subprocess.run([str(PROGRAM), *map(str, arguments)], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


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
