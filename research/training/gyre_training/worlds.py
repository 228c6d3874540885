"""The simulated training worlds and the pairs made of them, by calls of `gyre-worlds` and of `gyre-lab`."""

import os
import subprocess
import tomllib
from pathlib import Path

from .recipe import HOME, PROJECT

SPLITS = ("train", "validation", "test")


def find_gyre_lab(given: Path | None) -> Path:
    """Returns the program as given, or the build of this repository."""
    return find("gyre-lab", given, "give --gyre-lab")


def find_gyre_worlds() -> Path:
    """Returns the program in GYRE_WORLDS, else the build of this repository."""
    given = os.environ.get("GYRE_WORLDS")
    return find("gyre-worlds", Path(given) if given else None, "set GYRE_WORLDS")


def find(program: str, given: Path | None, otherwise: str) -> Path:
    """Returns a program of `research` as given, or its build."""
    places = [given] if given else [PROJECT / "research/target" / build / program for build in ("release", "debug")]
    for place in places:
        if place.is_file():
            return place.resolve()
    raise SystemExit(f"no {program} at {' or '.join(map(str, places))}: cargo build --release --manifest-path research/Cargo.toml -p {program}, or {otherwise}")


def simulate(folder: Path) -> None:
    """Renders every world of `worlds/` that is not in `folder`; an interrupted one is resumed."""
    gyre_worlds = find_gyre_worlds()
    for split in SPLITS:
        for world in worlds_of(split):
            call(gyre_worlds, world, "--out", folder / split / world.stem, "--format", "oxford", *trajectory(world))


def worlds_of(split: str) -> list[Path]:
    """Returns the worlds of a split, by name."""
    return sorted((HOME / "worlds" / split).glob("*.toml"))


def followed(world: Path) -> str | None:
    """Returns the trajectory file of the real drive that a world follows, None without one."""
    return tomllib.loads(world.read_text())["simulation"]["drive"].get("file")


def trajectory(world: Path) -> list[str | Path]:
    """Returns the option with the trajectory of a real drive, which is in the folder of real data."""
    file = followed(world)
    if not file:
        return []
    if "GYRE_DATA" not in os.environ:
        raise SystemExit(f"{world.name} follows {file}: set GYRE_DATA to the folder with trajectories/{file}")
    return ["--trajectory", Path(os.environ["GYRE_DATA"]) / "trajectories" / file]


def export_pairs(gyre_lab: Path, worlds: Path, raster: Path, folder: Path) -> None:
    """Writes `train.npy`, `validation.npy` and `test.npy` if they are missing; existing files of other pairs are refused."""
    folder.mkdir(parents=True, exist_ok=True)
    for split in SPLITS:
        out, names = folder / f"{split}.npy", [world.stem for world in worlds_of(split)]
        if out.exists():
            require_pairs_of(names, raster, out)
            continue
        recordings = [option for name in names for option in ("--data", worlds / split / name)]
        call(gyre_lab, "export-pairs", raster, *recordings, "--out", out)


def require_pairs_of(names: list[str], raster: Path, path: Path) -> None:
    """Refuses pairs of other recordings or of another configuration."""
    there = tomllib.loads(path.with_suffix(".toml").read_text())
    wanted = tomllib.loads(raster.read_text())
    others = sorted({one["name"] for one in there["sequences"]} ^ set(names))
    unlike = [f"{section}.{key}" for section, values in wanted.items() for key, value in values.items()
              if section in there and there[section].get(key, value) != value]
    if others or unlike:
        raise SystemExit(f"{path} was made with other settings ({', '.join(others + unlike)}): delete it, or give another --work")


def call(*words) -> None:
    """Runs a command with its output on the terminal."""
    done = subprocess.run([str(word) for word in words])
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, words))}: exit status {done.returncode}")
