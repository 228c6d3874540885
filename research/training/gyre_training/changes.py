"""Trains the network that finds what has changed between two drives: `research/changes/changes.onnx`.

It is shown how both drives saw each cell of 0.5 m, as `research/changes/src/survey.rs`
draws it, and says where a car stood on the first one that is gone on the second one. What has
appeared is gone with the drives exchanged. The truth is the simulator's.

The pairs are files that `cargo run --example changes` writes into the folder `CHANGES_PLANES`.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as functional
from torch import nn

from .planes import batches, convolution, export, level, optimise

CELL_M, SIDE = 0.5, 128
"""Cells a side that the program shows the network at once."""
SHOWN = 384
PLANES = 4
"""How well a cell is known that is compared: `LEAST_KNOWN` of the program."""
LEAST_KNOWN = 0.2
"""What is within the outline of a car by more than this has changed; what is nearer to it may be
said to have or not."""
INSIDE_M = 0.3


@dataclass
class Pair:
    """Two drives through one town."""

    corner: np.ndarray
    """The first cell along x and y."""
    planes: np.ndarray
    """How both drives saw each cell: 2 x PLANES x cells along x and y, of 255."""
    cars: np.ndarray
    """Is gone, x, y, yaw, length, width, is in sight, a row each."""


def read(path: Path) -> Pair:
    """Reads the file of a pair."""
    values = np.fromfile(path, dtype="<f4")
    corner, size, cars = values[:2], values[2:4].astype(int), int(values[4])
    rows, planes = values[5 : 5 + 7 * cars], values[5 + 7 * cars :]
    planes = np.rint(planes * 255).astype(np.uint8)
    return Pair(corner, planes.reshape(2, PLANES, *size), rows.reshape(cars, 7).astype(np.float64))


def places(pair: Pair) -> np.ndarray:
    """Returns the cells that both drives know, half of them those of cars that have changed."""
    known = pair.planes[:, 0].min(axis=0) >= 255 * LEAST_KNOWN
    cells = np.argwhere(known)
    cars = np.rint(pair.cars[pair.cars[:, 6] > 0, 1:3] / CELL_M - pair.corner).astype(int)
    return np.concatenate([cells, np.repeat(cars, len(cells) // max(len(cars), 1), axis=0)])


KEPT, UNCHANGED = 0.3, 0.2
"""Shares of the cars whose returns are kept as they are, and of those that are put into both
drives; the others have returns that are made anew."""


def look(random: np.random.Generator) -> np.ndarray:
    """Draws places of a car that return: along and across from -1 to 1, share of the looks,
    strength and radius, m, a row each. Simulated cars are four corners and some panels; real ones are
    specks anywhere that come and go, as those of vehicles that move."""
    places = random.uniform(-1, 1, (random.integers(3, 16), 2))
    is_edge = random.random(len(places)) < random.random()
    places[is_edge] /= np.abs(places[is_edge]).max(axis=1, keepdims=True)
    shares = random.uniform(0.2, 1.0) * random.uniform(0.4, 1.0, len(places))
    strengths = (random.uniform(0.3, 1.0) + 0.15 * random.normal(size=len(places))).clip(0.1, 1.2)
    return np.column_stack([places, shares, strengths, np.full(len(places), random.uniform(0.4, 0.7))])


def repaint(planes: np.ndarray, body: np.ndarray, outside_m: np.ndarray, its: np.ndarray) -> None:
    """Gives a car the returns of a look instead of its own."""
    planes[1:] *= ((outside_m - 0.2) / 0.6).clip(0, 1)
    along, across, share, strength, radius_m = its.T[:, :, None, None].astype(np.float32)
    away_m = np.hypot((body[0] - along) * 2.25, (body[1] - across) * 0.95)
    # Its place is not the same in all looks.
    seen = share * (1.6 - away_m / radius_m).clip(0, 1)
    for plane, counted in enumerate((strength, strength / 0.2, (strength - 0.4) / 0.4)):
        np.maximum(planes[1 + plane], (seen * counted.clip(0, 1)).max(axis=0), out=planes[1 + plane])


MIDDLE = SIDE / 2 - 0.5
STEPS = np.stack(np.meshgrid(*2 * [np.arange(SIDE) - MIDDLE], indexing="ij"), axis=-1)


def sample(pair: Pair, centre: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, ...]:
    """Draws what is around a cell, turned at random: the planes, where a car is gone, and where the
    network has to know it."""
    first = random.integers(2)
    turn_rad, mirror = random.uniform(0, 2 * np.pi), random.choice([-1.0, 1.0])
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    turn = np.array([[cos, -sin * mirror], [sin, cos * mirror]])
    centre = centre + random.integers(-SIDE // 4, SIDE // 4, 2)
    at = STEPS.reshape(-1, 2) @ turn.T + centre
    drawn = np.zeros((2, PLANES, SIDE * SIDE), np.float32)
    for planes, drive in zip(drawn, (first, 1 - first)):
        # A later drive is not placed exactly, and no radar is as strong as the other.
        moved = random.normal(0, 0.25, 2) * (random.random() < 0.5)
        rows, columns = np.rint(at + moved).astype(int).T
        inside = (rows >= 0) & (rows < pair.planes.shape[2]) & (columns >= 0) & (columns < pair.planes.shape[3])
        planes[:, inside] = pair.planes[drive][:, rows[inside], columns[inside]]
        planes[1:] *= random.uniform(0.85, 1.15)
    drawn = (drawn / 255).clip(0, 1).reshape(2 * PLANES, SIDE, SIDE)
    is_gone, counts = np.zeros((SIDE, SIDE), np.float32), np.minimum(drawn[0], drawn[PLANES]) >= LEAST_KNOWN
    for gone, x, y, yaw, length, width, in_sight in pair.cars:
        row, column = ((x, y) / np.array(CELL_M) - pair.corner - 0.5 - centre) @ turn + MIDDLE
        around = tuple(slice(max(int(it) - 9, 0), max(int(it) + 10, 0)) for it in (row, column))
        away_m = (STEPS[around] - (row - MIDDLE, column - MIDDLE)) * CELL_M
        if away_m.size == 0:
            continue
        ahead = np.array([np.cos(yaw), np.sin(yaw)]) @ turn
        along, across = away_m @ ahead, away_m @ [-ahead[1], ahead[0]]
        outside_m = np.maximum(np.abs(along) - length / 2, np.abs(across) - width / 2)
        chance, its = random.random(), look(random)
        body = np.stack([along / length, across / width]).astype(np.float32) * 2
        for planes, is_own in ((drawn[:PLANES], bool(gone) == (first == 0)), (drawn[PLANES:], bool(gone) != (first == 0))):
            if chance < UNCHANGED or is_own and chance > UNCHANGED + KEPT:
                its[:, 2:4] *= random.uniform(0.7, 1.1, (len(its), 2))
                repaint(planes[(slice(None), *around)], body, outside_m, its)
        if chance < UNCHANGED:
            continue
        if bool(gone) != (first == 0):
            continue
        is_inside = (outside_m < -INSIDE_M) & bool(in_sight)
        is_gone[around][is_inside] = 1.0
        counts[around] &= is_inside | (outside_m > (0.0 if in_sight else 0.5))
    return drawn, is_gone, counts.astype(np.float32)


class Network(nn.Module):
    """How two drives saw each cell in, the logarithm of the odds of a change out."""

    def __init__(self, widths: tuple[int, ...] = (24, 32, 48, 64)):
        super().__init__()
        half, quarter, eighth, sixteenth = widths
        self.at_half = nn.Sequential(convolution(2 * PLANES, half, 2), convolution(half, half))
        self.at_quarter = level(half, quarter)
        self.at_eighth = level(quarter, eighth)
        self.at_sixteenth = level(eighth, sixteenth)
        self.to_eighth = convolution(sixteenth, eighth, size=1)
        self.of_eighth = convolution(eighth, eighth)
        self.to_quarter = convolution(eighth, quarter, size=1)
        self.of_quarter = convolution(quarter, quarter)
        self.to_half = convolution(quarter, half, size=1)
        self.of_half = convolution(half, half)
        self.values = nn.Conv2d(half, 4, 1)
        nn.init.constant_(self.values.bias, -5.0)

    def forward(self, planes: torch.Tensor) -> torch.Tensor:
        half = self.at_half(planes)
        quarter = self.at_quarter(half)
        eighth = self.at_eighth(quarter)
        up = self.to_eighth(self.at_sixteenth(eighth))
        up = self.of_eighth(functional.interpolate(up, scale_factor=2) + eighth)
        up = self.to_quarter(up)
        up = self.of_quarter(functional.interpolate(up, scale_factor=2) + quarter)
        up = self.to_half(up)
        up = self.of_half(functional.interpolate(up, scale_factor=2) + half)
        return functional.pixel_shuffle(self.values(up), 2)


def loss(log_odds: torch.Tensor, is_gone: torch.Tensor, counts: torch.Tensor) -> torch.Tensor:
    """The negative logarithm of the likelihood of the truth, in the mean over the cells of cars."""
    surprise = functional.binary_cross_entropy_with_logits(log_odds[:, 0], is_gone, reduction="none")
    return (surprise * counts).sum() / is_gone.sum().clamp(min=100)


def train(pairs: list[Pair], steps: int, batch: int = 16) -> Network:
    torch.manual_seed(0)
    network = Network().to(memory_format=torch.channels_last)
    centres = [places(pair) for pair in pairs]

    def draw(random: np.random.Generator) -> tuple[np.ndarray, ...]:
        chosen = random.integers(len(pairs))
        return sample(pairs[chosen], random.choice(centres[chosen]), random)

    optimise(network, batches(draw, steps, batch), loss)
    return network


def register(commands) -> None:
    command = commands.add_parser("changes", help="trains the network that finds changes between drives")
    command.add_argument("pairs", type=Path, help="the folder CHANGES_PLANES")
    command.add_argument("--steps", type=int, default=4000)
    command.add_argument("--out", type=Path, default=Path("out/models/changes.onnx"))
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    pairs = [read(path) for path in sorted(options.pairs.iterdir())]
    print(f"{len(pairs)} pairs, {sum(int(pair.cars[:, 6].sum()) for pair in pairs)} cars", flush=True)
    network = train(pairs, options.steps)
    export(network, torch.zeros(1, 2 * PLANES, SHOWN, SHOWN), options.out)
