"""Pairs of scans with their true motions, from a file of `gyre-lab export-pairs`."""

import hashlib
import json
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor


@dataclass(frozen=True)
class Batch:
    """Rasters (batch, n, n) of both scans and the true motions (batch, 3) between them: x, y (m), yaw (rad)."""

    later: Tensor
    earlier: Tensor
    motion: Tensor

    def to(self, device: torch.device) -> "Batch":
        return Batch(*(t.to(device, non_blocking=True) for t in (self.later, self.earlier, self.motion)))


def between(earlier: np.ndarray, later: np.ndarray) -> np.ndarray:
    """Returns the poses (k, 3) of the later frames in the earlier ones; arguments and result are x, y, yaw."""
    dx, dy = (later - earlier)[:, :2].T
    cos, sin = np.cos(earlier[:, 2]), np.sin(earlier[:, 2])
    yaw = later[:, 2] - earlier[:, 2]
    yaw = (yaw + np.pi) % (2 * np.pi) - np.pi
    return np.stack([cos * dx + sin * dy, -sin * dx + cos * dy, yaw], 1)


class Scans:
    """The scans of one file, mapped into memory."""

    def __init__(self, path: Path):
        self.records = np.load(path, mmap_mode="r")
        self.settings = tomllib.loads(path.with_suffix(".toml").read_text())
        self.n = self.records.dtype["raster"].shape[0]
        self.cell_m = float(self.settings["raster"]["cell_m"])
        self.sequence = np.array(self.records["sequence"])
        self.pose = np.array(self.records["pose"])

    def fingerprint(self) -> str:
        """Returns a hash of the poses, of some rasters, and of the settings."""
        settings = {key: value for key, value in self.settings.items() if key not in ("sequences", "version", "commit")}
        digest = hashlib.sha256(json.dumps(settings, sort_keys=True, default=str).encode())
        digest.update(self.pose.tobytes())
        digest.update(self.records[:: max(1, len(self.records) // 16)].tobytes())
        return digest.hexdigest()

    def pairs(self, step: int) -> np.ndarray:
        """Returns the indices (k, 2) of the earlier and the later scan of all pairs that are `step` apart in one sequence."""
        first = np.arange(len(self.sequence) - step)
        first = first[self.sequence[first] == self.sequence[first + step]]
        return np.stack([first, first + step], 1)

    def motions(self, pairs: np.ndarray) -> np.ndarray:
        """Returns the true motions (k, 3)."""
        return between(self.pose[pairs[:, 0]], self.pose[pairs[:, 1]])

    def rasters(self, indices: np.ndarray) -> Tensor:
        """Returns the rasters (k, n, n)."""
        return torch.from_numpy(self.records["raster"][indices].astype(np.float32))

    def examples(self, inputs: int, count: int) -> Tensor:
        """Returns inputs of a network (count, inputs, n, n), spread evenly over the file: the later and the earlier scan, or a
        scan by itself."""
        pairs = self.pairs(1)
        pairs = pairs[np.linspace(0, len(pairs) - 1, count).astype(int)]
        return torch.stack([self.rasters(pair[[1, 0][:inputs]]) for pair in pairs])

    def batch(self, pairs: np.ndarray) -> Batch:
        motion = torch.from_numpy(self.motions(pairs)).float()
        return Batch(self.rasters(pairs[:, 1]), self.rasters(pairs[:, 0]), motion)


@dataclass(frozen=True)
class Sampling:
    """The choice of training pairs."""

    # Largest difference of the two scans' indices.
    steps: int = 3
    # Largest shift (m) along each axis and largest angle (deg): below the limits of the search, with a margin for the peak.
    reach_m: float = 11.0
    reach_deg: float = 18.0
    # A pair that moves less (m) and turns less (deg) is standing; only this share of such pairs is used.
    standing_m: float = 0.1
    standing_deg: float = 0.2
    standing_share: float = 0.1

    def pairs(self, scans: Scans, seed: int) -> np.ndarray:
        """Returns all training pairs in the order of the file."""
        pairs = np.concatenate([scans.pairs(step) for step in range(1, self.steps + 1)])
        motion = scans.motions(pairs)
        shift, angle = np.abs(motion[:, :2]).max(1), np.degrees(np.abs(motion[:, 2]))
        standing = (shift < self.standing_m) & (angle < self.standing_deg)
        drawn = np.random.default_rng([seed, 0x57A2D]).random(len(pairs)) < self.standing_share
        return pairs[(shift < self.reach_m) & (angle < self.reach_deg) & (~standing | drawn)]


def augmented(batch: Batch, rng: np.random.Generator) -> Batch:
    """Returns a copy that is randomly mirrored, reversed in time, and scaled in power."""
    count = len(batch.motion)
    mirrored, reversed_, gain = rng.random(count) < 0.5, rng.random(count) < 0.5, rng.uniform(0.8, 1.25, count)
    mirrored, reversed_ = torch.from_numpy(mirrored), torch.from_numpy(reversed_)
    gain = torch.from_numpy(gain).float()[:, None, None]
    later, earlier = (mirror(raster * gain, mirrored).clamp(max=255.0) for raster in (batch.later, batch.earlier))
    motion = torch.where(mirrored[:, None], batch.motion * torch.tensor([1.0, -1.0, -1.0]), batch.motion)
    swap = reversed_[:, None, None]
    return Batch(
        torch.where(swap, earlier, later),
        torch.where(swap, later, earlier),
        torch.where(reversed_[:, None], inverse(motion), motion),
    )


def mirror(rasters: Tensor, which: Tensor) -> Tensor:
    """Flips the rasters chosen by `which` left to right."""
    return torch.where(which[:, None, None], rasters.flip(2), rasters)


def inverse(motion: Tensor) -> Tensor:
    """Returns the poses of the earlier frames in the later ones."""
    x, y, yaw = motion.unbind(1)
    cos, sin = torch.cos(yaw), torch.sin(yaw)
    return torch.stack([-(cos * x + sin * y), sin * x - cos * y, -yaw], 1)
