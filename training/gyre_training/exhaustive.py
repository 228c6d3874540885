"""The search of Masking by Moving (Barnes et al. 2019): every angle with every shift. What f-mbym is measured against."""

import math

import torch
from torch import Tensor, nn

from .peaks import around, line_peak
from .search import SearchConfig, TranslationSearch, sampled


class ExhaustiveMatch(nn.Module):
    """MbyM's search: every angle of a grid, each with all shifts (Barnes et al. 2019; `raw` in Weston et al.)."""

    def __init__(self, n: int, cell_m: float, config: SearchConfig, reach_deg: float = 15.0, step_deg: float = 1.0):
        super().__init__()
        self.translation = TranslationSearch(n, cell_m, config)
        count = int(reach_deg / step_deg + 1e-9)
        angles = torch.arange(-count, count + 1) * math.radians(step_deg)
        grid, inside = self.translation.places(angles)
        for name, value in {"angles": angles, "grid": grid, "inside": inside}.items():
            self.register_buffer(name, value, persistent=False)

    def _scores(self, later: Tensor, earlier: Tensor) -> Tensor:
        """Sums of products, (batch, angles, shifts, shifts): a factor common to all is nothing to either kind of peak."""
        search = self.translation
        # The batch as channels: all scans are turned by the same angles, so one set of places serves them all.
        turned = sampled(earlier.expand(len(self.angles), *earlier.shape), self.grid) * self.inside[:, None]
        return search.products(search.spectra(turned) * search.spectra(later).conj()).transpose(0, 1)

    def forward(self, later: Tensor, earlier: Tensor) -> Tensor:
        """The motion by soft peaks over all three unknowns: (batch, 3)."""
        within, shifts = self.translation.within, self.translation.shifts
        scores = self._scores(later, earlier)[:, :, within][..., within]
        weights = self.translation.config.soft.weights(scores.flatten(1)).view_as(scores)
        angles = (weights.sum((2, 3)) * self.angles).sum(1)
        near = shifts[within].to(weights)
        # A shift is one of g turned by its own angle: x and y are weighed, not shifts.
        u, v = near[:, None].expand(len(near), -1), near[None, :].expand(len(near), -1)
        x, y = (-self.translation.cell_m * s for s in (u, v))
        cos, sin = torch.cos(self.angles)[:, None, None], torch.sin(self.angles)[:, None, None]
        x, y = (weights * (cos * x - sin * y)).sum((1, 2, 3)), (weights * (sin * x + cos * y)).sum((1, 2, 3))
        return torch.stack([x, y, angles], 1)

    @torch.no_grad()
    def hard(self, later: Tensor, earlier: Tensor) -> Tensor:
        """The motion by the highest peak: (batch, 3)."""
        scores = self._scores(later, earlier)
        best = scores[:, :, self.translation.within][..., self.translation.within].amax((2, 3))
        k = best[:, 1:-1].argmax(1) + 1
        offset = line_peak("parabola", around(best, k, best.shape[1]))
        angles = (self.angles[k] + offset * (self.angles[1] - self.angles[0])).float()
        turned = self.translation.turned(earlier, angles)
        return self.translation.motion(self.translation.hard(self.translation.correlation(later, turned)), angles)
