"""Pairs of scans with their true motions, from the file that `gyre-lab export-pairs` writes."""

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
    """Rasters (batch, n, n) of both scans, and the motions (batch, 3) between them: x, y (m), yaw (rad)."""

    later: Tensor
    earlier: Tensor
    motion: Tensor

    def to(self, device: torch.device) -> "Batch":
        return Batch(*(t.to(device, non_blocking=True) for t in (self.later, self.earlier, self.motion)))


def between(earlier: np.ndarray, later: np.ndarray) -> np.ndarray:
    """The pose of the later frame in the earlier one: (k, 3) from two (k, 3) of x, y, yaw."""
    dx, dy = (later - earlier)[:, :2].T
    cos, sin = np.cos(earlier[:, 2]), np.sin(earlier[:, 2])
    yaw = later[:, 2] - earlier[:, 2]
    yaw = (yaw + np.pi) % (2 * np.pi) - np.pi
    return np.stack([cos * dx + sin * dy, -sin * dx + cos * dy, yaw], 1)


class Scans:
    """One file of scans, mapped into memory; nothing is read before it is needed."""

    def __init__(self, path: Path):
        self.records = np.load(path, mmap_mode="r")
        self.settings = tomllib.loads(path.with_suffix(".toml").read_text())
        self.n = self.records.dtype["raster"].shape[0]
        self.cell_m = float(self.settings["raster"]["cell_m"])
        self.sequence = np.array(self.records["sequence"])
        self.pose = np.array(self.records["pose"])

    def fingerprint(self) -> str:
        """What tells this file from others: its poses, some of its rasters, and what they are meant to be."""
        meant = {key: value for key, value in self.settings.items() if key not in ("sequences", "version", "commit")}
        digest = hashlib.sha256(json.dumps(meant, sort_keys=True, default=str).encode())
        digest.update(self.pose.tobytes())
        digest.update(self.records[:: max(1, len(self.records) // 16)].tobytes())
        return digest.hexdigest()

    def pairs(self, step: int) -> np.ndarray:
        """Indices (k, 2) of the earlier and the later of scans that are `step` apart in the same sequence."""
        first = np.arange(len(self.sequence) - step)
        first = first[self.sequence[first] == self.sequence[first + step]]
        return np.stack([first, first + step], 1)

    def motions(self, pairs: np.ndarray) -> np.ndarray:
        """True motions (k, 3)."""
        return between(self.pose[pairs[:, 0]], self.pose[pairs[:, 1]])

    def rasters(self, indices: np.ndarray) -> Tensor:
        """(k, n, n)."""
        return torch.from_numpy(self.records["raster"][indices].astype(np.float32))

    def batch(self, pairs: np.ndarray) -> Batch:
        motion = torch.from_numpy(self.motions(pairs)).float()
        return Batch(self.rasters(pairs[:, 1]), self.rasters(pairs[:, 0]), motion)


@dataclass(frozen=True)
class Sampling:
    """Which pairs a network learns from."""

    # How many scans lie between the two at most, the later one counted.
    steps: int = 3
    # Largest shift (m) along each axis and largest angle (deg): what lies at a search's edge teaches nothing.
    reach_m: float = 11.0
    reach_deg: float = 18.0
    # What moves less (m) and turns less (deg) is standing, and only this share of such pairs is kept.
    standing_m: float = 0.1
    standing_deg: float = 0.2
    standing_share: float = 0.1

    def pairs(self, scans: Scans, seed: int) -> np.ndarray:
        """All pairs to learn from, in the file's order."""
        pairs = np.concatenate([scans.pairs(step) for step in range(1, self.steps + 1)])
        motion = scans.motions(pairs)
        shift, angle = np.abs(motion[:, :2]).max(1), np.degrees(np.abs(motion[:, 2]))
        standing = (shift < self.standing_m) & (angle < self.standing_deg)
        lucky = np.random.default_rng([seed, 0x57A2D]).random(len(pairs)) < self.standing_share
        return pairs[(shift < self.reach_m) & (angle < self.reach_deg) & (~standing | lucky)]


def augmented(batch: Batch, rng: np.random.Generator) -> Batch:
    """The same scenes as other drives could have seen them: mirrored, driven backward in time, with another gain."""
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
    """Left and right exchanged where `which` says so."""
    return torch.where(which[:, None, None], rasters.flip(2), rasters)


def inverse(motion: Tensor) -> Tensor:
    """The pose of the earlier frame in the later one."""
    x, y, yaw = motion.unbind(1)
    cos, sin = torch.cos(yaw), torch.sin(yaw)
    return torch.stack([-(cos * x + sin * y), sin * x - cos * y, -yaw], 1)
