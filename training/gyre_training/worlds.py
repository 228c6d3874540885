"""The simulated worlds that are learnt from, and the pairs made of them: calls of `gyre-lab`."""

import os
import subprocess
import tomllib
from pathlib import Path

from .recipe import HOME, PROJECT

SPLITS = ("train", "validation", "test")


def find_gyre(given: Path | None) -> Path:
    """The program: as given, or the project's own build."""
    places = [given] if given else [PROJECT / "target" / build / "gyre-lab" for build in ("release", "debug")]
    for place in places:
        if place.is_file():
            return place.resolve()
    raise SystemExit(f"no gyre-lab at {' or '.join(map(str, places))}: cargo build --release -p gyre-lab, or name it with --gyre")


def simulate(gyre: Path, folder: Path) -> None:
    """Renders every world of `worlds/` that `folder` does not hold already; one that is cut off goes on."""
    for split in SPLITS:
        for world in worlds_of(split):
            call(gyre, "simulate", world, "--out", folder / split / world.stem, "--format", "oxford", *trajectory(world))


def worlds_of(split: str) -> list[Path]:
    """The worlds of a split, by name."""
    return sorted((HOME / "worlds" / split).glob("*.toml"))


def followed(world: Path) -> str | None:
    """The file of the real drive that a world follows."""
    return tomllib.loads(world.read_text())["simulation"]["drive"].get("file")


def trajectory(world: Path) -> list[str | Path]:
    """The option that names a real drive's trajectory, which lies with the real data."""
    file = followed(world)
    if not file:
        return []
    if "GYRE_DATA" not in os.environ:
        raise SystemExit(f"{world.name} follows {file}: set GYRE_DATA to the folder whose trajectories/ has it")
    return ["--trajectory", Path(os.environ["GYRE_DATA"]) / "trajectories" / file]


def export_pairs(gyre: Path, worlds: Path, raster: Path, folder: Path) -> None:
    """Writes `train.npy`, `validation.npy` and `test.npy`, those that are not there. What is there and something else is refused."""
    folder.mkdir(parents=True, exist_ok=True)
    for split in SPLITS:
        out, names = folder / f"{split}.npy", [world.stem for world in worlds_of(split)]
        if out.exists():
            require_pairs_of(names, raster, out)
            continue
        recordings = [option for name in names for option in ("--data", worlds / split / name)]
        call(gyre, "export-pairs", raster, *recordings, "--out", out)


def require_pairs_of(names: list[str], raster: Path, path: Path) -> None:
    """Refuses pairs of other recordings, or as another configuration makes them."""
    there = tomllib.loads(path.with_suffix(".toml").read_text())
    wanted = tomllib.loads(raster.read_text())
    others = sorted({one["name"] for one in there["sequences"]} ^ set(names))
    unlike = [f"{section}.{key}" for section, values in wanted.items() for key, value in values.items()
              if section in there and there[section].get(key, value) != value]
    if others or unlike:
        raise SystemExit(f"{path} was made otherwise ({', '.join(others + unlike)}): delete it, or name another --work")


def call(*words) -> None:
    """Runs a command; what it says goes to the terminal."""
    done = subprocess.run([str(word) for word in words])
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, words))}: exit status {done.returncode}")
