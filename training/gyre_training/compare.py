"""Networks of finished trainings side by side: how long a mask takes, and how far motions lead astray with it."""

import tempfile
import time
from argparse import Namespace
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import plots, recipe
from .drift import Drift, drift, motions
from .export import OnnxMasks, export, quantise
from .pairs import Scans
from .search import ScanMatch
from .train import trained

ROUNDS = 40


@dataclass(frozen=True)
class Contender:
    """One network in one kind of numbers. `pair_ms`: the masks that a pair costs, on one thread; where a network looks at
    each scan alone, the earlier scan has its mask already."""

    name: str
    numbers: str
    megabytes: float
    pair_ms: float
    drift: Drift


def register(commands) -> None:
    command = commands.add_parser("compare", help="time and drift of trained networks, in floats and in integers")
    command.add_argument("folder", type=Path, nargs="+", help="a training's folder; all for one raster")
    command.add_argument("--pairs", type=Path, required=True, help="folder with train.npy, to calibrate on, and test.npy")
    command.add_argument("--out", type=Path, default=Path("out/compare"), help="for compare.md and compare.svg")
    command.set_defaults(run=compare)


def compare(options: Namespace) -> None:
    calibration, test = (Scans(options.pairs / f"{split}.npy") for split in ("train", "test"))
    with tempfile.TemporaryDirectory() as scratch:
        files = [file for folder in options.folder for file in exported(folder, calibration, Path(scratch))]
        times = median_ms([OnnxMasks(file) for file in files], test)
        unmasked = drift_of(None, test)
        contenders = [
            Contender(*file.stem.split("."), file.stat().st_size / 1e6, pair_ms, drift_of(OnnxMasks(file), test))
            for file, pair_ms in zip(files, times)
        ]
    options.out.mkdir(parents=True, exist_ok=True)
    table = markdown(contenders, unmasked)
    (options.out / "compare.md").write_text(table)
    plots.speed_and_drift(contenders, options.out / "compare.svg")
    print(table, end="")


def exported(folder: Path, calibration: Scans, scratch: Path) -> list[Path]:
    """The best epoch as NAME.floats.onnx and NAME.integers.onnx."""
    floats, integers = (scratch / f"{folder.name}.{numbers}.onnx" for numbers in ("floats", "integers"))
    export(trained(folder / "best.pt"), calibration.n, floats)
    quantise(floats, calibration, integers)
    return [floats, integers]


def median_ms(networks: list[OnnxMasks], scans: Scans) -> list[float]:
    """In turn, so that what else the machine does slows all alike."""
    pair = scans.rasters(scans.pairs(1)[0])[None]
    seconds = np.zeros((ROUNDS, len(networks)))
    for times in seconds:
        for k, network in enumerate(networks):
            given = pair[:, : network.inputs]
            began = time.perf_counter()
            network(given)
            times[k] = time.perf_counter() - began
    return list(1e3 * np.median(seconds, axis=0))


def drift_of(network: OnnxMasks | None, scans: Scans) -> Drift:
    pairs = scans.pairs(1)
    match = ScanMatch(scans.n, scans.cell_m, recipe.search_of(scans.settings))
    return drift(scans, motions(scans, pairs, network, match), pairs)


def markdown(contenders: list[Contender], unmasked: Drift) -> str:
    rows = [("no mask", "", "", "", unmasked)]
    rows += [(one.name, one.numbers, f"{one.megabytes:.1f}", f"{one.pair_ms:.1f}", one.drift) for one in contenders]
    lines = ["| network | numbers | MB | ms | translation, % | rotation, deg/100 m |", "|---|---|---|---|---|---|"]
    for *cells, error in rows:
        cells += [f"{error.translation_percent:.2f}", f"{error.rotation_deg_per_100m:.2f}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
