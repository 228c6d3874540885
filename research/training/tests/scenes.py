"""Synthetic scenes: scatterers seen from known poses."""

import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from gyre_training.pairs import Scans


def scene(n: int, cell_m: float, motion: tuple[float, float, float], seed: int = 1, dtype=torch.float32) -> tuple[Tensor, Tensor]:
    """Returns rasters (later, earlier) of (1, n, n): the same scatterers after and before the motion, drawn without FFT."""
    generator = torch.Generator().manual_seed(seed)
    radius = 0.45 * n * cell_m * torch.rand(60, generator=generator).sqrt()
    bearing = 2 * math.pi * torch.rand(60, generator=generator)
    earlier = torch.stack([radius * torch.cos(bearing), radius * torch.sin(bearing)], 1)
    x, y, yaw = motion
    turn = torch.tensor([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    later = (earlier - torch.tensor([x, y])) @ turn  # R^T (p - t)
    return draw(n, cell_m, later, dtype), draw(n, cell_m, earlier, dtype)


def draw(n: int, cell_m: float, points: Tensor, dtype=torch.float32) -> Tensor:
    middle = (n - 1) / 2
    cells = torch.arange(n, dtype=torch.float64)
    row, col = middle - points[:, 0] / cell_m, middle - points[:, 1] / cell_m
    down = torch.exp(-((cells[None] - row[:, None].double()) ** 2) / (2 * 1.2**2))
    right = torch.exp(-((cells[None] - col[:, None].double()) ** 2) / (2 * 1.2**2))
    return (100 * torch.einsum("pi,pj->ij", down, right))[None].to(dtype)


def write(path: Path, pose: np.ndarray, sequence: list[int] | None = None, rasters: np.ndarray | None = None) -> Scans:
    """Writes a file in the format of `gyre-lab export-pairs` and reads it back: true poses (k, 3), rasters of 1 m cells."""
    rasters = np.zeros((len(pose), 2, 2)) if rasters is None else rasters
    n = rasters.shape[1]
    fields = {"raster": ("<f2", (n, n)), "pose": ("<f8", (3,)), "sequence": ("<u4", ())}
    records = np.zeros(len(pose), [(name, *kind) for name, kind in fields.items()])
    records["raster"], records["pose"], records["sequence"] = rasters, pose, 0 if sequence is None else sequence
    np.save(path, records)
    path.with_suffix(".toml").write_text(f"[raster]\nn = {n}\ncell_m = 1.0\n")
    return Scans(path)


def drive(path: Path, scans: int, n: int = 32, seed: int = 1) -> Scans:
    """Writes a drive of 3 m a scan through scatterers, with a bend to the left and back."""
    rng = np.random.default_rng(seed)
    yaw = 0.3 * np.sin(np.arange(scans) / 4)
    steps = np.stack([3 * np.cos(yaw), 3 * np.sin(yaw)], 1)
    pose = np.column_stack([np.concatenate([[[0, 0]], steps[:-1].cumsum(0)]), yaw])
    points = rng.uniform((-16, -30), (3 * scans + 16, 30), (20 * scans, 2))
    cos, sin = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    dx, dy = (points[None] - pose[:, None, :2]).transpose(2, 0, 1)
    seen = np.stack([cos * dx + sin * dy, -sin * dx + cos * dy], -1)
    rasters = [draw(n, 1.0, torch.from_numpy(one))[0].clamp(max=255).numpy() for one in seen]
    return write(path, pose, rasters=np.stack(rasters))
