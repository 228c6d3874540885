"""Statistics of scans on a common grid, by which `research/lab/realism.py` compares recordings."""

import cmath
import itertools
import math
from dataclasses import dataclass

import gyre
import numpy as np

# A bin counts as saturated if its power is less than so many counts below the highest that the
# recording has. A receiver at its limit piles powers up there; where the limit lies is the sensor's
# own, and no recording known reaches 255.
SATURATED_LEVELS = 4
# Longest lags of the autocorrelations: metres of range, and this part of a turn.
RANGE_LAG_M = np.float32(12.0)
TURN_PART = 8
# Cells of the rasters in which consecutive scans are compared, m.
CELL_M = np.float32(0.4)
# The largest motion within a sweep that a sensor makes, as of `gyre`.
MAX_TURN_RAD, MAX_TRAVEL_M = 2.0, 1e4


class Failure(Exception):
    """What cannot be compared, in a sentence."""


@dataclass
class Sample:
    """A scan on the common grid, and its motion (a complex position, a yaw) since the scan before it, if that is known."""

    scan: gyre.Scan
    motion: tuple[complex, float] | None = None


def common_grid(scans):
    """The depth of a cell, m, and the number of cells: the coarsest resolution over the shortest range.

    Cells begin at the first bin's near edge, without any offset: so what the sensor itself puts into a scan (ringing, noise) falls into
    the same cells whatever offset a configuration names.
    """
    resolution_m = max(scan.range_resolution_m for scan in scans)
    shortest_m = min(scan.power.shape[1] * scan.range_resolution_m for scan in scans)
    # A resolution as float32 must not cost the last cell.
    cells = int(shortest_m / resolution_m + 1e-4)
    if cells == 0:
        raise Failure("the recordings' scans have no range in common")
    return resolution_m, cells


def resample(scan, resolution_m, cells):
    """The scan with its powers averaged over each cell of a grid, a bin that two cells share by its parts, in whole counts.

    Where the scan has no more bins there is nothing: power 0.
    """
    azimuths, bins = scan.power.shape
    bins_a_cell = resolution_m / scan.range_resolution_m
    edges = np.arange(cells + 1) * bins_a_cell
    whole = np.minimum(edges.astype(int), bins)
    sums = np.zeros((azimuths, bins + 1))
    np.cumsum(scan.power, axis=1, dtype=float, out=sums[:, 1:])
    part = np.where(whole < bins, edges - whole, 0.0) * scan.power[:, np.minimum(whole, bins - 1)]
    means = np.diff(sums[:, whole] + part, axis=1) / bins_a_cell
    power = (np.trunc(means) + (means % 1.0 >= 0.5)).astype(np.uint8, order="C")
    return moved(scan, power=power, range_resolution_m=resolution_m)


def moved(scan, **changed):
    """The scan with other powers, or at another time."""
    names = ["power", "stamp_ns", "range_resolution_m", "clockwise", "azimuth_stamp_ns", "azimuth_rad", "azimuth_flags"]
    names += ["range_offset_m", "doppler_s"]
    return gyre.Scan(**{name: getattr(scan, name) for name in names} | changed)


def histogram(scans):
    """The number of times that each power from 0 to 255 occurs."""
    return sum(np.bincount(scan.power.ravel(), minlength=256) for scan in scans)


def percentile(counts, share):
    """The least power that at least this share of all does not exceed; 0 of nothing."""
    below = np.cumsum(counts)
    return int(np.argmax((below >= share * below[-1]) & (below > 0)))


def share_above(counts, threshold):
    """The share of the powers above a threshold."""
    return counts[threshold + 1 :].sum() / counts.sum()


def wasserstein(a, b):
    """The first Wasserstein distance of two histograms, counts: how far powers must be moved, on average, to become the others."""
    return np.abs(np.cumsum(a) / a.sum() - np.cumsum(b) / b.sum()).sum()


def saturated_share(counts):
    """The share of the powers that pile up at the highest one."""
    highest = int(np.flatnonzero(counts).max(initial=0))
    return share_above(counts, highest - SATURATED_LEVELS) if highest >= SATURATED_LEVELS else 0.0


def mean_power(samples):
    """The mean power at each range."""
    rows = sum(sample.scan.power.shape[0] for sample in samples)
    return sum(sample.scan.power.sum(axis=0, dtype=np.int64) for sample in samples) / rows


def products(samples, axis, lags):
    """For each lag the sum of the products of powers that are so far apart: round the turn in azimuth, axis 0, or in range, axis 1.

    Sums of products are whole numbers, so that rounding makes those of the transform exact.
    """
    sums = np.zeros(lags)
    for power in (sample.scan.power for sample in samples):
        length = power.shape[axis] + axis * lags
        spectrum = np.abs(np.fft.rfft(power, length, axis=axis)) ** 2
        sums += np.rint(np.fft.irfft(spectrum.sum(axis=1 - axis), length)[:lags])
    return sums


def correlation_in_range(samples, means, resolution_m):
    """The autocorrelation by lags in cells, 1 at lag 0, after subtracting the mean at each range."""
    rows, cells = sum(sample.scan.power.shape[0] for sample in samples), len(means)
    lags = np.arange(min(int(RANGE_LAG_M / np.float32(resolution_m)) + 1, cells))
    expected = np.array([means[: cells - lag] @ means[lag:] for lag in lags])
    return normalised((products(samples, 1, len(lags)) / rows - expected) / (cells - lags))


def correlation_in_azimuth(samples, means):
    """The same by lags in azimuths."""
    rows, azimuths = sum(sample.scan.power.shape[0] for sample in samples), samples[0].scan.power.shape[0]
    return normalised(products(samples, 0, -(-azimuths // TURN_PART)) / rows - means @ means)


def normalised(covariances):
    """Covariances by the variance; none where all powers at a range are the same: what is left of rounding is no variance."""
    return covariances / covariances[0] if covariances[0] > 1e-9 else covariances[:0]


def lag_at_half(values):
    """The lag at which an autocorrelation first falls to a half, on the straight line between its values; None where it never does.

    A half rather than 1/e: streets and streaks give the curve a long flat tail, and there 1/e lies. In range it is crossed at 2.5 to
    4.4 m on real drives that have 1.2 to 1.4 m at a half.
    """
    after = next((lag for lag, value in enumerate(values) if value <= 0.5), 0)
    if after == 0:
        return None
    above, below = values[after - 1], values[after]
    return after - (below - 0.5) / (below - above)


def velocity(motion, interval_s):
    """The velocity (x, y, yaw rate) of a motion: the logarithm of SE(2), the chord turned back by half of the yaw and stretched."""
    chord, yaw = motion
    arc = chord * cmath.exp(-0.5j * yaw) / np.sinc(0.5 * yaw / math.pi) / interval_s
    return arc.real, arc.imag, yaw / interval_s


def is_possible(velocity, scan):
    """Whether a sensor moves so within a sweep. By a wrong motion nothing is compared."""
    longest_s = np.abs(scan.azimuth_stamp_ns - scan.stamp_ns).max() * 1e-9
    x_mps, y_mps, yaw_rate_radps = velocity
    # False for what is not a number, too.
    return math.hypot(x_mps, y_mps) * longest_s <= MAX_TRAVEL_M and abs(yaw_rate_radps) * longest_s <= MAX_TURN_RAD


def change(samples, range_m, threshold):
    """How each scan differs from the one before it, seen from the same place: pairs, correlation, share without counterpart.

    Both are drawn as seen from where the sensor was half-way between, by one motion at constant velocity through both sweeps: so both
    sweeps are motion-compensated and aligned in one step, and blurred alike.
    """
    n = 2 * int(range_m / float(CELL_M)) + 1
    masking = {"kind": "threshold", "threshold": threshold, "undo_doppler": True}
    masker = gyre.Masker(gyre.Config({"raster": {"n": n, "cell_m": 0.4}, "masking": masking, "points": {"capacity": 0}}))
    steps = np.arange(n) - n // 2
    circle = steps[:, None] ** 2 + steps**2 <= (n // 2) ** 2
    correlations, returns, alone = [], 0, 0
    for earlier, later in itertools.pairwise(samples):
        interval_ns = later.scan.stamp_ns - earlier.scan.stamp_ns
        if later.motion is None or interval_ns == 0:
            continue
        moving = velocity(later.motion, interval_ns * 1e-9)
        between_ns = earlier.scan.stamp_ns + interval_ns // 2
        scans = [moved(sample.scan, stamp_ns=between_ns) for sample in (earlier, later)]
        if not all(is_possible(moving, scan) for scan in scans):
            continue
        rasters = [masker.mask(scan, moving).raster for scan in scans]
        a, b = (raster[circle].astype(float) for raster in rasters)
        if np.ptp(a) > 0.0 and np.ptp(b) > 0.0:
            correlations.append(np.corrcoef(a, b)[0, 1])
        for these, those in (rasters, reversed(rasters)):
            returns += np.count_nonzero(these)
            near = np.lib.stride_tricks.sliding_window_view(np.pad(those > 0.0, 1), (3, 3)).any(axis=(2, 3))
            alone += np.count_nonzero((these > 0.0) & ~near)
    known = correlations and returns
    return (len(correlations), np.mean(correlations), alone / returns) if known else (0, None, None)


def statistics(samples, raw, resolution_m):
    """What is measured of scans, `raw` the histogram of the sensor's own bins."""
    threshold = gyre.Config().to_dict()["masking"]["threshold"]
    counts, means = histogram(sample.scan for sample in samples), mean_power(samples)
    # Single cells are noisy.
    near, far = (int(range_m / resolution_m) for range_m in (9.5, 10.5))
    lags = lag_at_half(correlation_in_range(samples, means, resolution_m)), lag_at_half(correlation_in_azimuth(samples, means))
    pairs, correlation, unmatched_share = change(samples, len(means) * resolution_m, threshold)
    return {
        "histogram": counts,
        "mean_power": means,
        "scans": len(samples),
        "pairs": pairs,
        "power_at_10_m": means[near : far + 1].mean() if far < len(means) else None,
        "range_correlation_m": lags[0] and lags[0] * resolution_m,
        "azimuth_correlation_deg": lags[1] and lags[1] * (360.0 / samples[0].scan.power.shape[0]),
        "saturated_share": saturated_share(raw),
        "share_above": share_above(counts, threshold),
        "next_correlation": correlation,
        "next_unmatched_share": unmatched_share,
    }
