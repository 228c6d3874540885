"""Resampling of rasters to polar coordinates and back, so that convolutions run over azimuth and range."""

import math
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

AZIMUTHS = 400
# Azimuths that are repeated at either end, so that convolutions are circular; a multiple of every fold.
MARGIN = 16


def to_polar(rasters: Tensor) -> Tensor:
    """Resamples (batch, features, n, n) to (batch, features, azimuths with margins, ranges) with the cell size of the raster."""
    return sampled(rasters, polar_grid(int(rasters.shape[-1])), "zeros")


def to_raster(polar: Tensor, n: int) -> Tensor:
    """Resamples (batch, features, azimuths with margins, ranges) to (batch, features, n, n)."""
    return sampled(polar, raster_grid(int(n), int(polar.shape[-1])), "border")


def sampled(x: Tensor, grid: Tensor, padding: str) -> Tensor:
    grid = grid.to(x.device).expand(x.shape[0], -1, -1, -1)
    return F.grid_sample(x, grid, mode="bilinear", padding_mode=padding, align_corners=False)


# In NumPy, so that an ONNX file has the sampling grid as a constant instead of its computation.
@lru_cache(maxsize=8)
def polar_grid(n: int) -> Tensor:
    """Returns the `grid_sample` coordinates of each azimuth and range in a raster: (1, azimuths with margins, ranges, 2)."""
    ranges = np.arange(math.ceil(n / math.sqrt(2))) + 0.5
    azimuths = math.tau / AZIMUTHS * np.arange(-MARGIN, AZIMUTHS + MARGIN)
    rows, columns = np.outer(np.sin(azimuths), ranges), np.outer(np.cos(azimuths), ranges)
    return coordinates(columns / (n / 2), rows / (n / 2))


@lru_cache(maxsize=8)
def raster_grid(n: int, ranges: int) -> Tensor:
    """Returns the `grid_sample` coordinates of each cell in azimuth and range: (1, n, n, 2)."""
    offset = np.arange(n) - (n - 1) / 2
    rows, columns = np.meshgrid(offset, offset, indexing="ij")
    azimuth = np.arctan2(rows, columns) % math.tau * AZIMUTHS / math.tau + MARGIN
    return coordinates(2 * np.hypot(rows, columns) / ranges - 1, 2 * (azimuth + 0.5) / (AZIMUTHS + 2 * MARGIN) - 1)


def coordinates(x: np.ndarray, y: np.ndarray) -> Tensor:
    return torch.from_numpy(np.stack([x, y], -1)[None].astype(np.float32))
