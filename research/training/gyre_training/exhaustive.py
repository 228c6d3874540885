"""The search of Masking by Moving (Barnes et al. 2019), every angle with every shift: the baseline of f-mbym."""

import math

import torch
from torch import Tensor, nn

from .peaks import around, line_peak
from .search import SearchConfig, TranslationSearch, sampled


class ExhaustiveMatch(nn.Module):
    """The exhaustive search over a grid of angles and all shifts (`raw` in Weston et al.)."""

    def __init__(self, n: int, cell_m: float, config: SearchConfig, reach_deg: float = 15.0, step_deg: float = 1.0):
        super().__init__()
        self.translation = TranslationSearch(n, cell_m, config)
        count = int(reach_deg / step_deg + 1e-9)
        angles = torch.arange(-count, count + 1) * math.radians(step_deg)
        grid, inside = self.translation.places(angles)
        for name, value in {"angles": angles, "grid": grid, "inside": inside}.items():
            self.register_buffer(name, value, persistent=False)

    def _scores(self, later: Tensor, earlier: Tensor) -> Tensor:
        """Returns the correlations (batch, angles, shifts, shifts), not normalised: a common factor changes neither kind of peak."""
        search = self.translation
        # The batch as channels: all scans are rotated by the same angles, so they share one sampling grid.
        turned = sampled(earlier.expand(len(self.angles), *earlier.shape), self.grid) * self.inside[:, None]
        return search.products(search.spectra(turned) * search.spectra(later).conj()).transpose(0, 1)

    def forward(self, later: Tensor, earlier: Tensor) -> Tensor:
        """Returns the motions (batch, 3) by a soft-argmax over all three unknowns."""
        within, shifts = self.translation.within, self.translation.shifts
        scores = self._scores(later, earlier)[:, :, within][..., within]
        weights = self.translation.config.soft.weights(scores.flatten(1)).view_as(scores)
        angles = (weights.sum((2, 3)) * self.angles).sum(1)
        near = shifts[within].to(weights)
        # A shift is in the frame of the rotated scan: the mean is over x and y, not over shifts.
        u, v = near[:, None].expand(len(near), -1), near[None, :].expand(len(near), -1)
        x, y = (-self.translation.cell_m * s for s in (u, v))
        cos, sin = torch.cos(self.angles)[:, None, None], torch.sin(self.angles)[:, None, None]
        x, y = (weights * (cos * x - sin * y)).sum((1, 2, 3)), (weights * (sin * x + cos * y)).sum((1, 2, 3))
        return torch.stack([x, y, angles], 1)

    @torch.no_grad()
    def hard(self, later: Tensor, earlier: Tensor) -> Tensor:
        """Returns the motions (batch, 3) by the highest peak."""
        scores = self._scores(later, earlier)
        best = scores[:, :, self.translation.within][..., self.translation.within].amax((2, 3))
        k = best[:, 1:-1].argmax(1) + 1
        offset = line_peak("parabola", around(best, k, best.shape[1]))
        angles = (self.angles[k] + offset * (self.angles[1] - self.angles[0])).float()
        turned = self.translation.turned(earlier, angles)
        return self.translation.motion(self.translation.hard(self.translation.correlation(later, turned)), angles)
