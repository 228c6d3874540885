"""Rasters in polar coordinates and back: convolutions then see azimuth and range, as the sensor does."""

import math
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

AZIMUTHS = 400
# So many azimuths stand at either end once more, so that convolutions go round; a multiple of every fold.
MARGIN = 16


def to_polar(rasters: Tensor) -> Tensor:
    """(batch, features, n, n) to (batch, features, azimuths with their margins, ranges): a range's cell is a raster's."""
    return sampled(rasters, polar_places(int(rasters.shape[-1])), "zeros")


def to_raster(polar: Tensor, n: int) -> Tensor:
    """(batch, features, azimuths with their margins, ranges) to (batch, features, n, n)."""
    return sampled(polar, raster_places(int(n), int(polar.shape[-1])), "border")


def sampled(x: Tensor, grid: Tensor, beyond: str) -> Tensor:
    grid = grid.to(x.device).expand(x.shape[0], -1, -1, -1)
    return F.grid_sample(x, grid, mode="bilinear", padding_mode=beyond, align_corners=False)


# In NumPy, so that an ONNX file has the places themselves, and not how they were found.
@lru_cache(maxsize=8)
def polar_places(n: int) -> Tensor:
    """Where each azimuth and range lies in a raster: (1, azimuths with their margins, ranges, 2), as `grid_sample` counts."""
    ranges = np.arange(math.ceil(n / math.sqrt(2))) + 0.5
    azimuths = math.tau / AZIMUTHS * np.arange(-MARGIN, AZIMUTHS + MARGIN)
    rows, columns = np.outer(np.sin(azimuths), ranges), np.outer(np.cos(azimuths), ranges)
    return places(columns / (n / 2), rows / (n / 2))


@lru_cache(maxsize=8)
def raster_places(n: int, ranges: int) -> Tensor:
    """Where each cell of a raster lies among azimuths and ranges: (1, n, n, 2), as `grid_sample` counts."""
    offset = np.arange(n) - (n - 1) / 2
    rows, columns = np.meshgrid(offset, offset, indexing="ij")
    azimuth = np.arctan2(rows, columns) % math.tau * AZIMUTHS / math.tau + MARGIN
    return places(2 * np.hypot(rows, columns) / ranges - 1, 2 * (azimuth + 0.5) / (AZIMUTHS + 2 * MARGIN) - 1)


def places(x: np.ndarray, y: np.ndarray) -> Tensor:
    return torch.from_numpy(np.stack([x, y], -1)[None].astype(np.float32))
