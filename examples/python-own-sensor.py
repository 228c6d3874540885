"""Odometry of a radar that Gyre has no reader for: each of its sweeps is an array.

Here the sweeps are computed, of a sensor that drives 2 m ahead in each. Yours come from a driver or a file: all the rest stays.
"""

from collections.abc import Iterator

import gyre
import numpy as np

AZIMUTHS, BINS, BIN_M, SWEEP_S, SPEED_MPS = 400, 720, 0.125, 0.25, 8.0

noise = np.random.default_rng(1)
reflectors_m = noise.uniform(-90, 90, (2, 800))


def sweeps(count: int) -> Iterator[gyre.Scan]:
    for number in range(count):
        x_m, y_m = reflectors_m - [[SPEED_MPS * SWEEP_S * number], [0.0]]
        azimuth = np.round(np.arctan2(-y_m, x_m) / (2 * np.pi) * AZIMUTHS).astype(int) % AZIMUTHS  # clockwise
        x_m = x_m - SPEED_MPS * SWEEP_S * (azimuth / AZIMUTHS - 0.5)  # where the sensor is when it looks there
        bins = (np.hypot(x_m, y_m) / BIN_M).astype(int)
        power = noise.integers(0, 40, (AZIMUTHS, BINS), dtype=np.uint8)
        for beam, strength in ((-1, 120), (1, 120), (0, 200)):
            seen = bins < BINS
            power[(azimuth + beam)[seen] % AZIMUTHS, bins[seen]] = strength
        yield gyre.Scan(
            power, stamp_ns=int(number * SWEEP_S * 1e9), sweep_s=SWEEP_S, range_resolution_m=BIN_M, clockwise=True
        )


odometry = gyre.Odometry(gyre.Config({"masking": {"threshold": 60}}))
for scan in sweeps(20):
    registered = odometry.register(scan)
    print(registered.seq, registered.outcome, registered.pose)
