"""A dataset format of your own: a folder of files `STAMP.u8`, each a sweep without a header, named by the time of its middle, ns.

    python examples/python-own-dataset.py FOLDER

The same format in Rust, where it is also inspected: examples/own_dataset.rs.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import gyre
import numpy as np

AZIMUTHS, BINS, BIN_M, SWEEP_S = 400, 576, 100 / 576, 0.25


def sweeps(folder: Path) -> Iterator[gyre.Scan]:
    """Yields the scans of a folder, ordered by time."""
    for file in sorted(folder.glob("*.u8"), key=lambda file: int(file.stem)):
        power = np.memmap(file, np.uint8, mode="r", shape=(AZIMUTHS, BINS))  # registered where it lies: nothing is copied
        yield gyre.Scan(power, stamp_ns=int(file.stem), sweep_s=SWEEP_S, range_resolution_m=BIN_M, clockwise=True)


if __name__ == "__main__":
    odometry = gyre.Odometry()
    for scan in sweeps(Path(sys.argv[1])):
        odometry.register(scan)
    odometry.trajectory.write_tum("trajectory.tum")
    print(odometry.trajectory)
