"""The decoupled scan matching of Weston et al., Algorithm 1 (ScanMatch), differentiable and batched.

Frames and signs are those of Gyre's own search: rasters are (batch, n, n), row 0 far ahead, column 0 far left; a motion
(x, y, yaw) is the pose of the later frame in the earlier one, in m and rad, y to the left and yaw counter-clockwise. With
u, v the cells down and right of the middle, x = -u and y = -v.

Differences from Algorithm 1 as printed: correlations have a conjugate (lines 13 and 18), no angle and no shift occurs
twice (lines 2 to 4), and rasters are padded only for the shifts that are searched (line 17).
"""

import math
from dataclasses import dataclass, field

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .peaks import SUPPORT, SoftArgmax, around, line_peak, parabola, plane_peak


@dataclass(frozen=True)
class SearchConfig:
    """The settings of the search, named as in Gyre's sections `[rotation]` and `[translation]`."""

    form: str = "eq7"
    window: str = "hann"
    band_low: float = 0.01
    band_high: float = 0.35
    angles: int = 733
    radii: int = 127
    reach_deg: float = 20.0
    reach_m: float = 12.0
    overlap: str = "none"
    peak: str = "parabola"
    soft: SoftArgmax = field(default_factory=SoftArgmax)


def fast_size(least: int) -> int:
    """Returns the transform size that Gyre takes for at least `least` samples: even, with factors 2, 3, 5 and 11, where 5 and
    11 cost a quarter more. It defines the frequencies of the rotation search, so it must be the same here."""

    def rest(n: int, primes: tuple[int, ...]) -> int:
        for prime in primes:
            while n % prime == 0:
                n //= prime
        return n

    sizes = (n for n in range(max(least, 8), 2 * max(least, 8) + 1) if n % 2 == 0 and rest(n, (2, 3, 5, 11)) == 1)
    return min(sizes, key=lambda n: n if rest(n, (2, 3)) == 1 else 1.25 * n)


def window(kind: str, n: int) -> Tensor:
    """Returns the taper of an n x n raster before its transform (line 5)."""
    t = torch.arange(n, dtype=torch.float64) - (n - 1) / 2
    half = (n + 1) / 2

    def hann(t: Tensor) -> Tensor:
        return torch.where(t.abs() < half, 0.5 + 0.5 * torch.cos(math.pi * t / half), 0.0)

    if kind == "hann":
        return (hann(t)[:, None] * hann(t)[None, :]).float()
    if kind == "radial_hann":
        return hann(torch.hypot(t[:, None], t[None, :])).float()
    return torch.ones(n, n)


class RotationSearch(nn.Module):
    """The search for the angle between two scans by their magnitude spectra (lines 5 to 15)."""

    def __init__(self, n: int, config: SearchConfig):
        super().__init__()
        self.config, self.size = config, fast_size(n)
        self.register_buffer("window", window(config.window, n), persistent=False)
        grid, self.rows, self.columns = self._polar_grid()
        self.register_buffer("grid", grid, persistent=False)
        self.step = math.pi / config.angles
        reach = int(math.radians(config.reach_deg) / self.step)
        self.register_buffer("shifts", torch.arange(-reach, reach + 1), persistent=False)

    def _polar_grid(self) -> tuple[Tensor, int, int]:
        """Returns the `grid_sample` coordinates of the polar samples in the spectrum of the band (line 11), and its rows and
        columns."""
        config = self.config
        bins = int(config.band_high * self.size) + 1
        rho = torch.linspace(config.band_low, config.band_high, config.radii, dtype=torch.float64) * self.size
        theta = -math.pi / 2 + torch.arange(config.angles, dtype=torch.float64) * (math.pi / config.angles)
        u, v = rho[:, None] * torch.cos(theta), rho[:, None] * torch.sin(theta)
        u, v = torch.where(v < 0, -u, u), v.abs()  # the magnitudes of a real image are symmetric
        return torch.stack([2 * v / bins - 1, u / bins], -1)[None].float(), bins, bins + 1

    def spectra(self, rasters: Tensor) -> Tensor:
        """Returns the polar magnitudes, transformed along the angle: (batch, profiles, angles // 2 + 1)."""
        plane = torch.fft.rfft2(rasters * self.window, s=(self.size, self.size))[..., : self.columns]
        plane = torch.cat([plane[:, -self.rows :], plane[:, : self.rows + 1]], 1)
        # The root is not differentiable at 0; the term added is far below the rounding of a raster.
        magnitude = (plane.real.square() + plane.imag.square() + 1e-12).sqrt()
        grid = self.grid.expand(len(rasters), -1, -1, -1)
        polar = F.grid_sample(magnitude[:, None], grid, align_corners=True, padding_mode="border")[:, 0]
        if self.config.form == "line14":
            polar = polar.sum(1, keepdim=True)  # the mean over all radial shifts equals that of the summed profiles
        return torch.fft.rfft(polar - polar.mean(2, keepdim=True), dim=2)

    def correlation(self, later: Tensor, earlier: Tensor) -> Tensor:
        """Returns the scores (batch, angles) of all angles within reach (Eq. 7, or line 14)."""
        cross = (self.spectra(earlier) * self.spectra(later).conj()).sum(1)
        return torch.fft.irfft(cross, n=self.config.angles, dim=1)[:, self.shifts % self.config.angles]

    def soft(self, scores: Tensor) -> Tensor:
        """Returns the angles (batch,) by the soft-argmax, rad."""
        return (self.config.soft.weights(scores) * self.shifts).sum(1) * self.step

    def local(self, scores: Tensor) -> Tensor:
        """Returns the angles (batch,) of the highest peaks by a parabola, rad; differentiable."""
        best = scores.detach()[:, 1:-1].argmax(1) + 1
        near = scores.gather(1, best[:, None] + torch.arange(-1, 2, device=scores.device))
        return (self.shifts[best] + parabola(near)) * self.step

    def hard(self, scores: Tensor) -> Tensor:
        """Returns the angles (batch,) of the highest peaks, rad."""
        best = scores[:, 1:-1].argmax(1) + 1
        offset = line_peak(self.config.peak, around(scores, best, len(self.shifts)))
        return (self.shifts[best] + offset) * self.step


# A point this far outside of a raster (cells) still counts as inside: the tolerance for rounding.
EDGE_CELLS = 1e-6


def turn(middle: Tensor, angles: Tensor) -> tuple[Tensor, Tensor]:
    """Returns R x of all cells x, down and right of the middle: each (angles, n, n)."""
    cos, sin = torch.cos(angles)[:, None, None], torch.sin(angles)[:, None, None]
    u, v = middle[:, None], middle[None, :]
    return cos * u - sin * v, sin * u + cos * v


def sampled(rasters: Tensor, grid: Tensor) -> Tensor:
    """Samples (k, channels, n, n) bilinearly; with border padding, as zero padding would darken the outermost cells."""
    return F.grid_sample(rasters, grid, align_corners=True, padding_mode="border")


class TranslationSearch(nn.Module):
    """The search for the shift between two scans whose angle is known (lines 16 to 21)."""

    def __init__(self, n: int, cell_m: float, config: SearchConfig):
        super().__init__()
        self.n, self.cell_m, self.config = n, cell_m, config
        self.reach = int(config.reach_m / cell_m + 1e-9)
        self.around = self.reach + SUPPORT
        self.size = fast_size(n + self.around)
        shifts = torch.arange(-self.around, self.around + 1)
        self.register_buffer("shifts", shifts, persistent=False)
        self.register_buffer("within", shifts.abs() <= self.reach, persistent=False)
        middle = torch.arange(n, dtype=torch.float32) - (n - 1) / 2
        self.register_buffer("middle", middle, persistent=False)

    def turned(self, rasters: Tensor, angles: Tensor) -> Tensor:
        """Returns the rotated rasters g'(x) = g(R x), zero if R x lies outside of g (line 16)."""
        grid, inside = self.places(angles)
        return sampled(rasters[:, None], grid)[:, 0] * inside

    def places(self, angles: Tensor) -> tuple[Tensor, Tensor]:
        """Returns the `grid_sample` coordinates of R x for each cell x, (angles, n, n, 2), and whether R x lies inside,
        (angles, n, n)."""
        u, v = turn(self.middle, angles)
        with torch.no_grad():
            # In double and with Gyre's tolerance: at angles near zero a whole row lies on the edge.
            farthest = torch.maximum(*(t.abs() for t in turn(self.middle.double(), angles.double())))
            inside = farthest <= (self.n - 1) / 2 + EDGE_CELLS
        return torch.stack([v, u], -1) / ((self.n - 1) / 2), inside

    def spectra(self, rasters: Tensor) -> Tensor:
        """Returns the half spectra of rasters (..., n, n), padded for the shifts; rows of zeros are not transformed."""
        return torch.fft.fft(torch.fft.rfft(rasters, n=self.size), n=self.size, dim=-2)

    def products(self, cross: Tensor) -> Tensor:
        """Transforms cross spectra back to correlations at the shifts; only the rows that are needed are transformed."""
        near = self.shifts % self.size
        rows = torch.fft.ifft(cross, dim=-2)[..., near, :]
        return torch.fft.irfft(rows, n=self.size)[..., near]

    def correlation(self, later: Tensor, turned: Tensor) -> Tensor:
        """Returns the scores (batch, shifts, shifts) of all shifts (down, right) (lines 17 and 18)."""
        scores = self.products(self.spectra(turned) * self.spectra(later).conj())
        if self.config.overlap == "energy":
            return scores / (self._overlap_energy(later, 1) * self._overlap_energy(turned, -1) + 1e-12).sqrt()
        energy = later.square().sum((1, 2)) * turned.square().sum((1, 2))
        return scores / (energy + 1e-12).sqrt()[:, None, None]

    def _overlap_energy(self, rasters: Tensor, sign: int) -> Tensor:
        """Returns the energy of each raster in the overlap after each shift, by summed areas."""
        sums = F.pad(rasters.double().square().cumsum(1).cumsum(2), (1, 0, 1, 0))
        low = (-sign * self.shifts).clamp_min(0)
        high = self.n - (sign * self.shifts).clamp_min(0)
        rows = sums[:, high] - sums[:, low]
        return (rows[:, :, high] - rows[:, :, low]).clamp_min(0).to(rasters.dtype)

    def soft(self, scores: Tensor) -> Tensor:
        """Returns the shifts (batch, 2) by the soft-argmax (down, right), cells."""
        scores = scores[:, self.within][:, :, self.within]
        weights = self.config.soft.weights(scores.flatten(1)).view_as(scores)
        shifts = self.shifts[self.within].to(weights)
        return torch.stack([(weights.sum(2) * shifts).sum(1), (weights.sum(1) * shifts).sum(1)], 1)

    def local(self, scores: Tensor) -> Tensor:
        """Returns the shifts (batch, 2) of the highest peaks by a parabola along each axis (down, right), cells;
        differentiable."""
        best = self._highest(scores.detach())
        steps, every = torch.arange(-1, 2, device=scores.device), torch.arange(len(scores), device=scores.device)[:, None]
        down = scores[every, best[:, :1] + steps, best[:, 1:]]
        right = scores[every, best[:, :1], best[:, 1:] + steps]
        return best - self.around + torch.stack([parabola(down), parabola(right)], 1)

    def _highest(self, scores: Tensor) -> Tensor:
        """Returns the indices (batch, 2) of the highest scores within reach (row, column)."""
        inner = scores[:, self.within][:, :, self.within]
        best = inner.flatten(1).argmax(1)
        return torch.stack([best // inner.shape[1], best % inner.shape[1]], 1) + SUPPORT

    def hard(self, scores: Tensor) -> Tensor:
        """Returns the shifts (batch, 2) of the highest peaks (down, right), cells."""
        best = self._highest(scores)
        offsets = [plane_peak(self.config.peak, s, i, j) for s, (i, j) in zip(scores.double(), best.tolist(), strict=True)]
        return best - self.around + torch.stack(offsets).to(scores.device)

    def motion(self, shift: Tensor, angles: Tensor) -> Tensor:
        """Returns the motions (batch, 3) of x, y, yaw: t = R t' (lines 20 and 21)."""
        x, y = (shift * -self.cell_m).unbind(1)
        cos, sin = torch.cos(angles), torch.sin(angles)
        return torch.stack([cos * x - sin * y, sin * x + cos * y, angles], 1)


class ScanMatch(nn.Module):
    """Algorithm 1: the motions between masked scans."""

    def __init__(self, n: int, cell_m: float, config: SearchConfig):
        super().__init__()
        self.rotation = RotationSearch(n, config)
        self.translation = TranslationSearch(n, cell_m, config)

    def forward(self, later: Tensor, earlier: Tensor) -> Tensor:
        """Returns the motions (batch, 3) by the soft-argmax; differentiable."""
        angles = self.rotation.soft(self.rotation.correlation(later, earlier))
        turned = self.translation.turned(earlier, angles)
        return self.translation.motion(self.translation.soft(self.translation.correlation(later, turned)), angles)

    def soft_and_local(self, later: Tensor, earlier: Tensor) -> tuple[Tensor, Tensor]:
        """Returns the motions (batch, 3) by the soft-argmax and those by parabolas at the highest peaks, both differentiable."""
        rotation = self.rotation.correlation(later, earlier)
        angles = self.rotation.soft(rotation)
        scores = self.translation.correlation(later, self.translation.turned(earlier, angles))
        local = self.translation.motion(self.translation.local(scores), self.rotation.local(rotation))
        return self.translation.motion(self.translation.soft(scores), angles), local

    @torch.no_grad()
    def hard(self, later: Tensor, earlier: Tensor) -> Tensor:
        """Returns the motions (batch, 3) by the highest peaks, as Gyre computes them."""
        angles = self.rotation.hard(self.rotation.correlation(later, earlier)).float()
        turned = self.translation.turned(earlier, angles)
        return self.translation.motion(self.translation.hard(self.translation.correlation(later, turned)), angles)
