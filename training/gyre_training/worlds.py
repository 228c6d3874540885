"""The simulated worlds that are learnt from, and the pairs made of them: calls of `gyre`."""

import os
import subprocess
import tomllib
from pathlib import Path

from .recipe import HOME, PROJECT

SPLITS = ("train", "validation", "test")


def find_gyre(given: Path | None) -> Path:
    """The program: as given, or the project's own build."""
    places = [given] if given else [PROJECT / "target" / build / "gyre" for build in ("release", "debug")]
    for place in places:
        if place.is_file():
            return place.resolve()
    raise SystemExit(f"no gyre at {' or '.join(map(str, places))}: cargo build --release, or name it with --gyre")


def simulate(gyre: Path, folder: Path) -> None:
    """Renders every world of `worlds/` that `folder` does not hold already; one that is cut off goes on."""
    for split in SPLITS:
        for world in sorted((HOME / "worlds" / split).glob("*.toml")):
            call(gyre, "simulate", world, "--out", folder / split / world.stem, "--format", "oxford", *trajectory(world))


def trajectory(world: Path) -> list[str | Path]:
    """The option that names a real drive's trajectory, which lies with the real data."""
    drive = tomllib.loads(world.read_text())["simulation"]["drive"]
    if "file" not in drive:
        return []
    if "GYRE_DATA" not in os.environ:
        raise SystemExit(f"{world.name} follows {drive['file']}: set GYRE_DATA to the folder whose trajectories/ has it")
    return ["--trajectory", Path(os.environ["GYRE_DATA"]) / "trajectories" / drive["file"]]


def export_pairs(gyre: Path, worlds: Path, raster: Path, folder: Path) -> None:
    """Writes `train.npy`, `validation.npy` and `test.npy`, those that are not there."""
    folder.mkdir(parents=True, exist_ok=True)
    for split in SPLITS:
        out = folder / f"{split}.npy"
        if out.exists():
            continue
        recordings = [option for world in sorted((worlds / split).iterdir()) for option in ("--data", world)]
        call(gyre, "export-pairs", raster, *recordings, "--out", out)


def call(*words) -> None:
    """Runs a command; what it says goes to the terminal."""
    done = subprocess.run([str(word) for word in words])
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, words))}: exit status {done.returncode}")
