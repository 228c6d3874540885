"""Trains the network that finds moving objects: `models/objects.onnx`.

A scan is drawn with those before it, as `shared/method/objects/src/raster.rs` does; the network says
where the centre of a vehicle that moves is, its velocity, heading and size, and how wrong it
may be (Zhou, Wang and Krähenbühl, "Objects as Points", 2019; Kendall and Gal, "What uncertainties
do we need in Bayesian deep learning for computer vision?", 2017). The truth is the simulator's.

The drives are files that `cargo run --example objects` keeps in the folder `OBJECTS_CACHE`.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as functional
from torch import nn

from .planes import batches, convolution, export, level, optimise

CELL_M, SIDE = 0.5, 256
RECENT, REMEMBERED = 6, 20
PLANES = RECENT + 2
"""A cell of the output is two by two of the input."""
OUT, OUT_M = SIDE // 2, 2 * CELL_M
"""Likelihood, centre (2), velocity (2), heading (2), size (2), logarithms of two deviations."""
VALUES = 11
SPEED_MPS, SIZE_M = 8.0, (4.5, 1.9)
"""Scans of a drive that have nothing before them."""
FIRST = 2
"""Each scan, every second and every third one: simulated towns have 4 to 9 m/s, roads have more."""
STRIDES = (1, 2, 3)


@dataclass
class Scan:
    """A scan as the example keeps it."""

    pose: np.ndarray
    """x, y, yaw of the sensor in the frame of the odometry."""
    twist: np.ndarray
    """Its velocity: m/s, m/s, rad/s."""
    points: np.ndarray
    """x, y, time, weight, Doppler's factor, a row each."""
    users: np.ndarray
    """id, x, y, vx, vy, yaw, is a vehicle, is seen, length, width, a row each, from the sensor."""


def read(path: Path) -> list[Scan]:
    """Reads the file of a drive."""
    values = np.fromfile(path, dtype="<f8")
    scans, at = [], 0

    def take(rows: int, columns: int) -> np.ndarray:
        nonlocal at
        at += rows * columns
        return values[at - rows * columns : at].reshape(rows, columns)

    while at < len(values):
        (head,) = take(1, 9)
        points, users = take(int(head[7]), 5), take(int(head[8]), 10)
        scans.append(Scan(head[1:4], head[4:7], points, users))
    return scans


def deskewed(points: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """Returns the points without the sensor's motion and Doppler shift: `SparsePoint::deskewed`."""
    seen, seconds = points[:, :2], points[:, 2]
    range_m = np.maximum(np.hypot(*seen.T), 1e-3)
    farther = points[:, 4] * (seen @ twist[:2]) / range_m / range_m
    half = 0.5 * twist[2] * seconds
    way = twist[:2] * seconds[:, None]
    return rotated(seen * (1 + farther)[:, None], 2 * half) + rotated(way, half)


def rotated(vectors: np.ndarray, angles_rad: np.ndarray) -> np.ndarray:
    cos, sin = np.cos(angles_rad), np.sin(angles_rad)
    x, y = vectors.T
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


@dataclass
class Sample:
    """What the network is shown, and what it should say."""

    cells: np.ndarray
    """Cells of the planes that are not zero."""
    values: np.ndarray
    """Their values, of 255."""
    users: np.ndarray
    """x, y as the beam shows them, vx, vy, yaw, length, width, is a vehicle or cyclist, is seen."""


def samples(scans: list[Scan], stride: int = 1) -> list[Sample]:
    """Draws scans of a drive with those before them: with a stride as if all drove faster by it."""
    scans = scans[::stride]
    placed = [rotated(deskewed(it.points, it.twist), it.pose[2]) + it.pose[:2] for it in scans]
    drawn = [sample(scans[: index + 1], placed[: index + 1]) for index in range(FIRST, len(scans))]
    for it in drawn:
        it.users[:, 2:4] *= stride
    return drawn


def sample(scans: list[Scan], placed: list[np.ndarray]) -> Sample:
    x, y, yaw = scans[-1].pose
    planes = np.zeros((PLANES - 1, SIDE * SIDE), np.float32)
    last = list(zip(scans, placed))[::-1][:REMEMBERED]
    for ago, (scan, places) in enumerate(last):
        at = np.floor(rotated(places - (x, y), -yaw) / CELL_M).astype(int) + SIDE // 2
        inside = ((at >= 0) & (at < SIDE)).all(axis=1)
        cells = at[inside, 0] * SIDE + at[inside, 1]
        if ago < RECENT:
            np.maximum.at(planes[ago], cells, np.clip(scan.points[inside, 3], 1 / 255, 1))
        else:
            planes[RECENT, np.unique(cells)] += 1 / (len(last) - RECENT)
    cells = np.flatnonzero(planes)
    values = np.maximum(planes.reshape(-1)[cells] * 255, 1).astype(np.uint8)
    return Sample(cells.astype(np.int32), values, shown(scans[-1]))


def shown(scan: Scan) -> np.ndarray:
    """Returns the road users where the scan shows them: at the time of their azimuth, and moved by
    the Doppler shift of their own velocity."""
    rows, bearings = [], np.arctan2(*deskewed(scan.points, scan.twist).T[::-1])
    for _, x, y, vx, vy, yaw, is_vehicle, is_seen, length, width in scan.users:
        at_x, at_y = x, y
        for _ in range(2 if len(bearings) else 0):
            apart = (bearings - np.arctan2(at_y, at_x) + np.pi) % (2 * np.pi) - np.pi
            _, _, seconds, _, doppler_s = scan.points[np.argmin(np.abs(apart))]
            away = np.array([at_x, at_y]) / max(np.hypot(at_x, at_y), 1e-9)
            at_x, at_y = (x, y) + np.array([vx, vy]) * seconds + away * doppler_s * (away @ (vx, vy))
        is_wanted = is_vehicle or length > 1.0  # Pedestrians are shorter.
        rows.append([at_x, at_y, vx, vy, yaw, length, width, is_wanted, is_seen])
    return np.array(rows, np.float32).reshape(-1, 9)


@dataclass
class Look:
    """The look of one vehicle's echoes. Simulated ones are a few corners and panels that stay as
    they are; real ones are specks all over the body that come and go, and fewer when near."""

    fixed: np.ndarray
    """Places of what lasts, from -1 to 1 along the vehicle and across it."""
    lasting: float
    """Share of the scans in which each of these is seen."""
    fleeting: float
    """Mean number of places, beyond one, that only one scan shows."""
    returns: float
    """Mean number of returns beyond 20 m, and the power of the range by which they are fewer
    nearer."""
    fewer_near: float
    weight: float
    """Mean weight, and its deviations from place to place and from scan to scan."""
    uneven: float
    flicker: float
    depth_m: float
    """Depth behind the near end at which echoes are weaker by a factor of e."""
    along_m: float
    """Scatter of the returns of a place along the beam, and that of what comes later."""
    late_m: float


def look(random: np.random.Generator) -> Look:
    fixed = random.uniform(-1, 1, (random.integers(2, 12), 2))
    is_edge = random.random(len(fixed)) < random.random()
    is_end = np.abs(fixed[:, 0]) > np.abs(fixed[:, 1])
    fixed[is_edge & is_end, 0] = np.sign(fixed[is_edge & is_end, 0])
    fixed[is_edge & ~is_end, 1] = np.sign(fixed[is_edge & ~is_end, 1])
    return Look(
        fixed=fixed,
        lasting=random.uniform(0.3, 0.95),
        fleeting=random.uniform(0, 8),
        returns=np.exp(random.uniform(np.log(10), np.log(60))),
        fewer_near=random.uniform(0, 1.5),
        weight=random.uniform(0.15, 0.95),
        uneven=random.uniform(0.05, 0.3),
        flicker=random.uniform(0.02, 0.25),
        depth_m=np.exp(random.uniform(0, np.log(12))),
        along_m=random.uniform(0.1, 0.5),
        late_m=random.choice([0.0, random.uniform(0, 1.5)]),
    )


REPAINTED = 0.85
"""Share of the vehicles whose echoes are made anew."""


def repainted(scans: list[Scan], random: np.random.Generator) -> list[Scan]:
    """Returns a drive with other echoes of its vehicles, where the simulation shows any. Those
    that have none left are not seen."""
    looks: dict[float, Look | None] = {}
    drive = []
    for scan in scans:
        here, users = deskewed(scan.points, scan.twist), scan.users.copy()
        points, is_gone = [], np.zeros(len(here), bool)
        for user, seen in zip(users, shown(scan)):
            x, y, vx, vy, yaw, length, width, is_wanted, _ = seen
            if not is_wanted or np.hypot(vx, vy) < 0.3:
                continue
            if user[0] not in looks:
                looks[user[0]] = look(random) if random.random() < REPAINTED else None
            its = looks[user[0]]
            ahead, aside = np.abs(rotated(here - (x, y), np.full(len(here), -yaw))).T
            is_own = (ahead < length / 2 + 0.7) & (aside < width / 2 + 0.7) & ~is_gone
            if its is None or not is_own.any():
                continue
            is_gone |= is_own
            in_view = min(1.0, np.count_nonzero(is_own) / 10)
            points.append(echoes(its, seen, in_view, scan, here, random))
            user[7] *= len(points[-1]) > 1
        drive.append(Scan(scan.pose, scan.twist, np.concatenate([scan.points[~is_gone], *points]), users))
    return drive


def echoes(its: Look, seen: np.ndarray, in_view: float, scan: Scan, here: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Returns the points of a vehicle, a row each, as in the scan."""
    x, y, _, _, yaw, length, width, *_ = seen
    range_m = max(np.hypot(x, y), 1.0)
    ray = np.array([x, y]) / range_m
    fleeting = random.uniform(-1, 1, (1 + random.poisson(its.fleeting), 2))
    places = np.concatenate([its.fixed[random.random(len(its.fixed)) < its.lasting], fleeting])
    places = rotated(places * (length / 2, width / 2), np.full(len(places), yaw)) + (x, y)
    depth_m = places @ ray
    fades = np.exp(-(depth_m - depth_m.min()) / its.depth_m)
    weights = its.weight + its.flicker * random.normal() + its.uneven * random.normal(size=len(places))
    weights = weights.clip(0.02, 1) * (0.5 + 0.5 * fades)
    mean = its.returns * in_view * min(1.0, range_m / 20) ** its.fewer_near * np.sqrt(length / SIZE_M[0])
    count = random.poisson(mean)
    of = random.choice(len(places), count, p=(fades + 0.02) / np.sum(fades + 0.02))
    along_m = random.normal(0, its.along_m, count) + its.late_m * random.exponential(1, count) * (random.random(count) < 0.3)
    across_m = random.normal(0, 0.15 + 0.007 * range_m, count)
    wanted = places[of] + np.outer(along_m, ray) + np.outer(across_m, [-ray[1], ray[0]])
    apart = np.arctan2(*here.T[::-1])[None] - np.arctan2(*wanted.T[::-1])[:, None]
    azimuth = np.argmin(np.abs((apart + np.pi) % (2 * np.pi) - np.pi), axis=1)
    points = np.column_stack([wanted, scan.points[azimuth, 2], (weights[of] * random.uniform(0.3, 1.1, count)).clip(0.02, 1), scan.points[azimuth, 4]])
    for _ in range(2):  # Where the sensor measured what is there.
        points[:, :2] += wanted - deskewed(points, scan.twist)
    return points


CENTRES_M = (np.arange(OUT) + 0.5 - OUT / 2) * OUT_M
ROWS_M, COLUMNS_M = np.meshgrid(CENTRES_M, CENTRES_M, indexing="ij")


def roughened(it: Sample, random: np.random.Generator) -> Sample:
    """Returns a sample as of a real road, where less of a scan is seen again in the next one: the
    poses are less sure, returns come and go, echoes are weaker or stronger, and there is clutter."""
    plane, rows, columns = it.cells // SIDE**2, it.cells // SIDE % SIDE - SIDE / 2, it.cells % SIDE - SIDE / 2
    values = it.values * random.uniform(0.5, 1.3)
    for user in it.users:
        fade(user, plane, rows, columns, values, random)
    values[plane == RECENT] = it.values[plane == RECENT] * random.uniform(0.4, 1.0)
    # The newest scan is where it is: the truth is relative to it.
    is_before = plane > 0
    is_moved = np.arange(RECENT + 1) > 0
    turn, ahead, aside = random.normal(0, [[np.radians(0.2)], [0.15 / CELL_M], [0.15 / CELL_M]], (3, RECENT + 1)) * is_moved
    jitter = random.uniform(0, 0.6)
    at_rows = rows - turn[plane] * columns + ahead[plane] + is_before * random.normal(0, jitter, len(rows))
    at_columns = columns + turn[plane] * rows + aside[plane] + is_before * random.normal(0, jitter, len(rows))
    clutter = random.integers(0, 600) * (RECENT + 1)
    plane = np.concatenate([plane, random.integers(0, RECENT + 1, clutter)])
    at = [np.rint(np.concatenate([moved, random.uniform(-SIDE / 2, SIDE / 2, clutter)])) + SIDE // 2 for moved in (at_rows, at_columns)]
    values = np.concatenate([values, random.uniform(5, 100, clutter)])
    is_kept = random.random(len(values)) > np.append(random.uniform(0, 0.4, RECENT), random.uniform(0, 0.2))[plane]
    is_kept &= (at[0] >= 0) & (at[0] < SIDE) & (at[1] >= 0) & (at[1] < SIDE)
    cells = plane * SIDE**2 + at[0].astype(int) * SIDE + at[1].astype(int)
    is_kept &= values > 0
    return Sample(cells[is_kept], values[is_kept].clip(1, 255), it.users)


def fade(user: np.ndarray, plane: np.ndarray, rows: np.ndarray, columns: np.ndarray, values: np.ndarray, random: np.random.Generator) -> None:
    """Weakens the echoes of a road user by up to 20 dB."""
    x, y, vx, vy, _, length, *_ = user
    ago_s = 0.25 * plane
    off = np.hypot(rows * CELL_M - x + vx * ago_s, columns * CELL_M - y + vy * ago_s)
    its = (off < 0.5 * length + 0.8) & (plane < RECENT)
    values[its] -= 255 * random.uniform(0, 0.65)


def drawn(it: Sample, mirrored: bool) -> np.ndarray:
    """Returns the planes of a sample."""
    planes = np.zeros((PLANES, SIDE, SIDE), np.float32)
    planes.reshape(-1)[it.cells] = it.values / np.float32(255)
    if mirrored:
        planes = planes[:, :, ::-1].copy()
    centres = (np.arange(SIDE) + 0.5 - SIDE / 2) * CELL_M
    planes[-1] = np.hypot(centres[:, None], centres[None, :]) / 64
    return planes


def wanted(it: Sample, mirrored: bool) -> tuple[np.ndarray, ...]:
    """Returns the likelihoods that the network should give, how much each counts, the other values,
    and where these count."""
    likely, counts = np.zeros((OUT, OUT), np.float32), np.ones((OUT, OUT), np.float32)
    values, near = np.zeros((8, OUT, OUT), np.float32), np.zeros((OUT, OUT), np.float32)
    nearest = np.full((OUT, OUT), np.inf, np.float32)
    for x, y, vx, vy, yaw, length, width, is_wanted, is_seen in it.users:
        if mirrored:
            y, vy, yaw = -y, -vy, -yaw
        row, column = int(x // OUT_M) + OUT // 2, int(y // OUT_M) + OUT // 2
        speed_mps = np.hypot(vx, vy)
        if not (0 <= row < OUT and 0 <= column < OUT) or speed_mps < 0.3:
            continue
        around = slice(max(row - 9, 0), row + 10), slice(max(column - 9, 0), column + 10)
        rows_m, columns_m = ROWS_M[around], COLUMNS_M[around]
        squared = (rows_m - x) ** 2 + (columns_m - y) ** 2
        if is_wanted and is_seen and speed_mps > 1.0:
            likely[around] = np.maximum(likely[around], np.exp(-squared / (2 * 1.2**2)))
            likely[row, column] = 1.0
            its = (squared < 1.6**2) & (squared < nearest[around])
            nearest[around][its], near[around][its] = squared[its], 1.0
            same = [vx, vy, np.cos(yaw), np.sin(yaw), np.log(length / SIZE_M[0]), np.log(width / SIZE_M[1])]
            values[(slice(None), *around)][:, its] = np.stack(
                [x - rows_m[its], y - columns_m[its], *(np.full(its.sum(), value) for value in same)]
            )
        else:
            # What is hidden, or slow, may be said to be there or not.
            counts[around][squared < max(2.5, 0.5 * length) ** 2] = 0.0
    counts[(likely > 0.1)] = np.where(likely[likely > 0.1] > 0.99, 1.0, counts[likely > 0.1])
    return likely, counts, values, near


class Network(nn.Module):
    """Planes of scans in, values of cells out, each in four planes of every other row and
    column."""

    def __init__(self, widths: tuple[int, ...] = (16, 32, 48, 64)):
        super().__init__()
        half, quarter, eighth, sixteenth = widths
        self.at_half = convolution(PLANES, half, 2)
        self.at_quarter = level(half, quarter)
        self.at_eighth = level(quarter, eighth)
        self.at_sixteenth = level(eighth, sixteenth)
        self.to_eighth = convolution(sixteenth, eighth, size=1)
        self.of_eighth = convolution(eighth, eighth)
        self.to_quarter = convolution(eighth, quarter, size=1)
        self.of_quarter = convolution(quarter, quarter)
        self.head = convolution(quarter, quarter)
        self.values = nn.Conv2d(quarter, 4 * VALUES, 1)
        nn.init.zeros_(self.values.bias)
        self.values.bias.data[:4] = -4.6  # One place in a hundred.

    def forward(self, planes: torch.Tensor) -> torch.Tensor:
        quarter = self.at_quarter(self.at_half(planes))
        eighth = self.at_eighth(quarter)
        up = self.to_eighth(self.at_sixteenth(eighth))
        up = self.of_eighth(functional.interpolate(up, scale_factor=2) + eighth)
        up = self.to_quarter(up)
        up = self.of_quarter(functional.interpolate(up, scale_factor=2) + quarter)
        return self.values(self.head(up))


def loss(values: torch.Tensor, likely: torch.Tensor, counts: torch.Tensor, true: torch.Tensor, near: torch.Tensor) -> torch.Tensor:
    """The focal loss of the likelihoods ("Objects as Points", Eq. 1), and for the cells near a
    centre the negative logarithms of the likelihoods of centre and velocity, and the differences of heading
    and size."""
    values = functional.pixel_shuffle(values, 2)
    said = torch.sigmoid(values[:, 0]).clamp(1e-5, 1 - 1e-5)
    is_centre = likely == 1.0
    right = -((1 - said) ** 2 * said.log() * is_centre).sum()
    wrong = -((1 - likely) ** 4 * said**2 * (1 - said).log() * ~is_centre * counts).sum()

    def mean(cells: torch.Tensor) -> torch.Tensor:
        return (cells * near).sum() / near.sum().clamp(min=1)

    def surprise(difference: torch.Tensor, log_sigma: torch.Tensor) -> torch.Tensor:
        return mean(0.5 * difference.square().sum(1) * torch.exp(-2 * log_sigma) + 2 * log_sigma)

    def apart(said: torch.Tensor, true: torch.Tensor) -> torch.Tensor:
        return mean(functional.smooth_l1_loss(said, true, reduction="none").sum(1))

    return (
        (right + wrong) / is_centre.sum().clamp(min=1)
        + 0.3 * surprise(values[:, 1:3] - true[:, 0:2], values[:, 9].clamp(-3, 2))
        + 0.3 * surprise(values[:, 3:5] * SPEED_MPS - true[:, 2:4], values[:, 10].clamp(-3, 3))
        + apart(values[:, 5:7], true[:, 4:6])
        + 0.5 * apart(values[:, 7:9], true[:, 6:8])
    )


def train(data: list[Sample], steps: int, batch: int = 8) -> Network:
    torch.manual_seed(0)
    network = Network().to(memory_format=torch.channels_last)

    def draw(random: np.random.Generator) -> tuple[np.ndarray, ...]:
        it, mirrored = data[random.integers(len(data))], bool(random.integers(2))
        shown = roughened(it, random) if random.random() < 0.7 else it
        return drawn(shown, mirrored), *wanted(it, mirrored)

    optimise(network, batches(draw, steps, batch), loss)
    return network


def register(commands) -> None:
    command = commands.add_parser("objects", help="trains the network that finds moving objects")
    command.add_argument("drives", type=Path, help="the folder OBJECTS_CACHE")
    command.add_argument("--steps", type=int, default=12000)
    command.add_argument("--out", type=Path, default=Path("out/models/objects.onnx"))
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    random = np.random.default_rng(1)
    drives = sorted(options.drives.iterdir())
    data = []
    for drive in map(read, drives):
        data += samples(drive)[::2]
        other = repainted(drive, random)
        data += [it for stride in STRIDES for it in samples(other, stride)]
    print(f"{len(drives)} drives, {len(data)} scans", flush=True)
    network = train(data, options.steps)
    export(network, torch.zeros(1, PLANES, SIDE, SIDE), options.out)
