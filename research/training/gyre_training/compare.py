"""Compares trained networks: the inference time of a mask and the drift of the odometry with it."""

import tempfile
import time
from argparse import Namespace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from . import plots, recipe
from .drift import Drift, drift, motions, split
from .export import OnnxMasks, export, quantise
from .pairs import Scans
from .results import Candidate
from .search import ScanMatch
from .train import trained

ROUNDS = 40


def register(commands) -> None:
    command = commands.add_parser("compare", help="inference time and drift of trained networks, in floats and in 8-bit integers")
    command.add_argument("folder", type=Path, nargs="+", help="the folders of runs, all with the same raster")
    command.add_argument("--pairs", type=Path, required=True, help="folder of train.npy (for calibration) and test.npy")
    command.add_argument("--out", type=Path, default=Path("out/compare"), help="output folder of compare.md and compare.svg")
    command.set_defaults(run=compare)


def compare(options: Namespace) -> None:
    calibration, test = (Scans(options.pairs / f"{split}.npy") for split in ("train", "test"))
    with tempfile.TemporaryDirectory() as scratch:
        files = [file for folder in options.folder for file in exported(folder, calibration, Path(scratch))]
        times = median_ms([OnnxMasks(file) for file in files], test)
        unmasked = drift_of(None, test)
        candidates = []
        for file, pair_ms in zip(files, times):
            (name, numbers), masks, megabytes = file.stem.split("."), OnnxMasks(file), file.stat().st_size / 1e6
            candidates.append(Candidate(name, numbers, megabytes, pair_ms, drift_of(masks, test)))
            if masks.inputs == 1 and numbers == "integers":
                again = drift_of(EverySecond(masks), test)
                candidates.append(Candidate(f"{name}, every second scan", numbers, megabytes, pair_ms / 2, again))
    options.out.mkdir(parents=True, exist_ok=True)
    table = markdown(candidates, unmasked)
    (options.out / "compare.md").write_text(table)
    plots.speed_and_drift(candidates, options.out / "compare.svg")
    print(table, end="")


def exported(folder: Path, calibration: Scans, scratch: Path) -> list[Path]:
    """Exports the best epoch as NAME.floats.onnx and NAME.integers.onnx."""
    floats, integers = (scratch / f"{folder.name}.{numbers}.onnx" for numbers in ("floats", "integers"))
    export(trained(folder / "best.pt"), calibration.n, floats)
    quantise(floats, calibration, integers)
    return [floats, integers]


def median_ms(networks: list[OnnxMasks], scans: Scans) -> list[float]:
    """Returns the median inference times. The networks take turns, so that other load on the machine affects all alike."""
    pair = scans.rasters(scans.pairs(1)[0])[None]
    seconds = np.zeros((ROUNDS, len(networks)))
    for times in seconds:
        for k, network in enumerate(networks):
            given = pair[:, : network.inputs]
            began = time.perf_counter()
            network(given)
            times[k] = time.perf_counter() - began
    return list(1e3 * np.median(seconds, axis=0))


class EverySecond:
    """Masks of every second scan, each used for the next scan as well: half the work. Takes consecutive pairs, an even
    number per call."""

    def __init__(self, masks: OnnxMasks):
        self.masks = masks

    def masked(self, later: Tensor, earlier: Tensor) -> tuple[Tensor, Tensor]:
        masks = self.masks(torch.cat([earlier[::2], later[-1:]])[:, None])[:, 0]
        of_earlier = masks.repeat_interleave(2, 0)[: len(earlier)]
        of_later = masks.repeat_interleave(2, 0)[1 : len(later) + 1]
        return later * of_later, earlier * of_earlier


def drift_of(network: OnnxMasks | EverySecond | None, scans: Scans) -> Drift:
    pairs = scans.pairs(1)
    match = ScanMatch(scans.n, scans.cell_m, recipe.search_of(scans.settings))
    # By sequence, so that no mask is used across sequences.
    found = [motions(scans, pairs[at], network, match) for at in split(scans.sequence[pairs[:, 0]])]
    return drift(scans, np.concatenate(found), pairs)


def markdown(candidates: list[Candidate], unmasked: Drift) -> str:
    rows = [("no mask", "", "", "", unmasked)]
    rows += [(one.name, one.numbers, f"{one.megabytes:.1f}", f"{one.pair_ms:.1f}", one.drift) for one in candidates]
    lines = ["| network | numbers | MB | ms | translation, % | rotation, deg/100 m |", "|---|---|---|---|---|---|"]
    for *cells, error in rows:
        cells += [f"{error.translation_percent:.2f}", f"{error.rotation_deg_per_100m:.2f}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
