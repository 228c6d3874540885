"""The simulated worlds that are learnt from, and the pairs made of them: calls of `gyre`."""

import os
import subprocess
import tomllib
from pathlib import Path

import numpy as np

from .card import toml
from .recipe import HOME, PROJECT

SPLITS = ("train", "validation", "test")

# How wrong a reader of a real radar is about its ranges (m) and its encoder (rad), at most. A network that has learnt from perfectly
# known radars alone leans on what is near, which such errors turn most.
RANGE_OFFSET_ERROR_M = 0.25
ECCENTRICITY_ERROR_RAD = 0.0015


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
            recording = folder / split / world.stem
            call(gyre, "simulate", world, "--out", recording, "--format", "oxford", *trajectory(world))
            if split != "test":
                miscalibrate(recording / "dataset.toml", seed_of(world))


def seed_of(world: Path) -> int:
    return tomllib.loads(world.read_text())["simulation"]["seed"]


def miscalibrate(options: Path, seed: int) -> None:
    """Lets the reader of a recording be a little wrong about the radar, as one is about real ones; always by the same."""
    values, kept = tomllib.loads(options.read_text()), options.with_name("dataset.exact.toml")
    exact = tomllib.loads(kept.read_text()) if kept.exists() else values
    kept.write_text("".join(f"{key} = {toml(value)}\n" for key, value in exact.items()))
    offset, eccentricity = np.random.default_rng([seed, 0xCA1]).uniform(-1, 1, 2)
    wrong = exact | {
        "range_offset_m": round(exact["range_offset_m"] + RANGE_OFFSET_ERROR_M * offset, 3),
        "azimuth_eccentricity_rad": round(exact["azimuth_eccentricity_rad"] + ECCENTRICITY_ERROR_RAD * eccentricity, 5),
    }
    options.write_text("".join(f"{key} = {toml(value)}\n" for key, value in wrong.items()))


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
