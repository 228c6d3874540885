"""The KITTI odometry errors (Geiger et al. 2012), with shorter segments for short sequences."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from .pairs import Scans, between

# Segment lengths, m. Many training worlds are shorter than the 800 m of KITTI.
LENGTHS = (50, 100, 150, 200, 300, 400, 500, 600, 700, 800)


@dataclass(frozen=True)
class Drift:
    """Mean errors over all segments, and of single motions (relative pose error)."""

    translation_percent: float
    rotation_deg_per_100m: float
    pair_m: float
    pair_deg: float

    def __str__(self) -> str:
        return (
            f"{self.translation_percent:.2f} %, {self.rotation_deg_per_100m:.2f} deg/100 m "
            f"(a pair: {self.pair_m:.3f} m, {self.pair_deg:.3f} deg)"
        )


def chain(motions: np.ndarray) -> np.ndarray:
    """Returns the poses (k + 1, 3) of k motions, the first at the origin."""
    poses = np.zeros((len(motions) + 1, 3))
    for k, (x, y, yaw) in enumerate(motions):
        cos, sin = np.cos(poses[k, 2]), np.sin(poses[k, 2])
        poses[k + 1] = poses[k] + (cos * x - sin * y, sin * x + cos * y, yaw)
    return poses


def segments(true: np.ndarray, found: np.ndarray, step: int = 4) -> np.ndarray:
    """Returns the errors (k, 2) of the segments of each length as in the KITTI development kit: translation (relative to the
    length) and rotation (rad/m)."""
    distance = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(true[:, :2], axis=0), axis=1))])
    errors = []
    for length in LENGTHS:
        first = np.arange(0, len(true), step)
        last = np.searchsorted(distance, distance[first] + length)
        first, last = first[last < len(true)], last[last < len(true)]
        if len(first):
            error = between(between(true[first], true[last]), between(found[first], found[last]))
            errors.append(np.stack([np.linalg.norm(error[:, :2], axis=1), np.abs(error[:, 2])], 1) / length)
    return np.concatenate(errors) if errors else np.zeros((0, 2))


def drift(scans: Scans, found: np.ndarray, pairs: np.ndarray) -> Drift:
    """Returns the drift of the motions `found` (k, 3) between consecutive scans."""
    true = scans.motions(pairs)
    sequence = scans.sequence[pairs[:, 0]]
    errors = np.concatenate([segments(chain(true[at]), chain(found[at])) for at in split(sequence)])
    single = between(true, found)
    share, turn = errors.mean(0) if len(errors) else (np.nan, np.nan)
    return Drift(
        float(100 * share),
        float(100 * np.degrees(turn)),
        float(np.linalg.norm(single[:, :2], axis=1).mean()),
        float(np.degrees(np.abs(single[:, 2])).mean()),
    )


def split(sequence: np.ndarray) -> list[np.ndarray]:
    """Returns the indices of each sequence."""
    return [np.flatnonzero(sequence == one) for one in np.unique(sequence)]


@torch.no_grad()
def motions(scans: Scans, pairs: np.ndarray, network: nn.Module | None, match: nn.Module, batch: int = 16) -> np.ndarray:
    """Returns the motions (k, 3) between scans with the masks of `network` (None: without masks), by the highest peaks."""
    device = next(match.buffers()).device
    found = []
    for k in range(0, len(pairs), batch):
        part = scans.batch(pairs[k : k + batch]).to(device)
        masked = network.masked(part.later, part.earlier) if network else (part.later, part.earlier)
        found.append(match.hard(*masked).double().cpu().numpy())
    return np.concatenate(found)
