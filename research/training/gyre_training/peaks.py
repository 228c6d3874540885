"""Peaks of scores: the soft-argmax, which is differentiable, and the highest peak with sub-sample interpolation."""

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class SoftArgmax:
    """The mean position, weighted by exp(temperature * score) (lines 15 and 19). Scores are centred and divided by their
    largest magnitude, so that a temperature means the same for any raster."""

    temperature: float = 48.0

    def weights(self, scores: Tensor) -> Tensor:
        """Returns the weights (batch, positions) of scores (batch, positions); each row sums to 1."""
        scores = scores - scores.mean(1, keepdim=True)
        largest = scores.abs().amax(1, keepdim=True).clamp_min(1e-20)
        return torch.softmax(self.temperature * scores / largest, 1)


# Samples on each side of the highest one that a fit uses, and the largest offset of a fit.
SUPPORT = 3
MAX_OFFSET = 0.75


def around(scores: Tensor, best: Tensor, count: int) -> Tensor:
    """Returns the samples within SUPPORT of the best one (batch, 2 SUPPORT + 1) in double; the ends are repeated."""
    at = best[:, None] + torch.arange(-SUPPORT, SUPPORT + 1, device=best.device)
    return scores.gather(1, at.clamp(0, count - 1)).double()


def line_peak(kind: str, samples: Tensor) -> Tensor:
    """Returns the offset of the maximum from the middle sample, by a parabola through three samples or through their
    logarithms above a pedestal (a Gaussian)."""
    near = samples[:, SUPPORT - 1 : SUPPORT + 2]
    if kind == "gaussian":
        highest = near[:, 1:2]
        lowest = torch.minimum(samples.amin(1, keepdim=True), highest)
        near = (near - (lowest - 0.05 * (highest - lowest))).log()
    return parabola(near)


def parabola(near: Tensor) -> Tensor:
    """Returns the offset of the vertex of the parabola through three samples (..., 3) from the middle one, 0 without a
    maximum."""
    a, b, c = near.unbind(-1)
    curvature = a - 2 * b + c
    offset = (0.5 * (a - c) / curvature.clamp_max(-1e-12)).clamp(-MAX_OFFSET, MAX_OFFSET)
    return torch.where(curvature < 0, offset, 0.0)


def plane_peak(kind: str, scores: Tensor, i: int, j: int) -> Tensor:
    """Returns the offset (down, right) of the maximum from the sample (i, j)."""
    near = scores[i - 1 : i + 2, j - 1 : j + 2]
    parabolas = parabola(torch.stack([near[:, 1], near[1]]))
    if kind != "gaussian":
        return parabolas
    wide = scores[i - SUPPORT : i + SUPPORT + 1, j - SUPPORT : j + SUPPORT + 1]
    lowest = wide.min()
    fit = paraboloid((near - (lowest - 0.05 * (near[1, 1] - lowest))).log())
    return parabolas if fit is None else fit


def paraboloid(near: Tensor) -> Tensor | None:
    """Returns the offset of the vertex of the least-squares paraboloid of 3 x 3 samples, None without a maximum nearby."""
    steps = torch.tensor([-1.0, 0.0, 1.0], dtype=torch.float64, device=near.device)
    i, j = steps[:, None], steps[None, :]
    gradient = torch.stack([(near * i).sum(), (near * j).sum()]) / 6
    cross = (near * i * j).sum() / 4
    down, right = (near * (3 * i * i - 2)).sum() / 3, (near * (3 * j * j - 2)).sum() / 3
    determinant = down * right - cross * cross
    if not (down < 0 and determinant > 0):
        return None
    offset = torch.stack([cross * gradient[1] - right * gradient[0], cross * gradient[0] - down * gradient[1]])
    offset = offset / determinant
    return offset if offset.abs().max() <= MAX_OFFSET else None
