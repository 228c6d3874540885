"""Drawn scenes: scatterers seen from two poses."""

import math

import torch
from torch import Tensor


def scene(n: int, cell_m: float, motion: tuple[float, float, float], seed: int = 1, dtype=torch.float32) -> tuple[Tensor, Tensor]:
    """(later, earlier), each (1, n, n): the same scatterers, drawn without any FFT, before and after the motion."""
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
