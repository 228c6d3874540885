#!/usr/bin/env python3
"""Measures how wrong RADIATE's ground truth is, by what does not share its error: the gyro, and a vehicle that stands.

    gyre run radiate $GYRE_DATA/radiate-2019-02-12 --out out/radiate
    lab/witnesses.py out/radiate $GYRE_DATA

Prints the rows of the table in research/notes/covariance.md: RMS over each of four times of what the truth's heading turns more than the gyro, what
odometry's turns more than the truth, and how far the receiver's position moves along an axis while the vehicle of `-standing` stands
(3.5 to 19 s). The gyro's bias is that of the whole drive.
"""

import argparse
from pathlib import Path

import numpy as np

TIMES_S = (0.25, 1.0, 4.0, 16.0)
LATE_S = 1.58
STANDS_S = (3.5, 19.0)
# Longer gaps are not interpolated over.
MAX_GAP_S = 0.3


def tum(path):
    """Times, positions and headings of a trajectory."""
    rows = np.loadtxt(path)
    stamps, quaternions = rows[:, 0], rows[:, 4:8]
    x, y, z, w = quaternions.T
    headings = np.unwrap(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    return stamps, rows[:, 1:3], headings


def change(stamps, values, starts, time_s):
    """What a series changes by over a time from each start; NaN outside of it and over its gaps."""
    ends = starts + time_s
    changes = np.interp(ends, stamps, values) - np.interp(starts, stamps, values)
    gaps = np.concatenate([[0], np.cumsum(np.diff(stamps) > MAX_GAP_S)])
    place = lambda times: np.clip(np.searchsorted(stamps, times), 0, len(stamps) - 1)
    broken = gaps[place(ends)] != gaps[np.maximum(place(starts) - 1, 0)]
    outside = (starts < stamps[0]) | (ends > stamps[-1])
    return np.where(broken | outside, np.nan, changes)


def rms(values):
    return np.sqrt(np.nanmean(values**2))


def gyro(path):
    """Times on the radar's clock, and the angle about the axis that points up."""
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    stamps = rows[:, 0] * 1e-9 - LATE_S
    rates = -rows[:, 3]
    steps = np.diff(stamps) * (rates[1:] + rates[:-1]) / 2
    return stamps, np.concatenate([[0], np.cumsum(steps)])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, help="the results of radiate-2019-02-12")
    parser.add_argument("data", type=Path, help="the folder of the recordings")
    arguments = parser.parse_args()
    drive = arguments.data / "radiate-2019-02-12"
    truth_s, _, truth = tum(drive / "ground_truth.tum")
    odometry_s, _, odometry = tum(arguments.run / "trajectory.tum")
    gyro_s, angles = gyro(drive / "imu_as_logged.csv")
    receiver_s, places, _ = tum(arguments.data / "radiate-2019-02-12-standing" / "gnss_as_logged.tum")
    stands = [receiver_s[0] + at for at in STANDS_S]
    print("RMS over    " + "".join(f"{time_s:>12} s" for time_s in TIMES_S))

    def line(name, figures, unit):
        print(f"{name:12}" + "".join(f"{figure:>10.3f} {unit:>3}" for figure in figures))

    def apart(one, other, time_s):
        turns = change(*one, odometry_s, time_s) - change(*other, odometry_s, time_s)
        return np.degrees(rms(turns - np.nanmean(turns)))

    by_gyro = [apart((truth_s, truth), (gyro_s, angles), time_s) for time_s in TIMES_S]
    line("truth, gyro", by_gyro, "deg")
    by_truth = [apart((odometry_s, odometry), (truth_s, truth), time_s) for time_s in TIMES_S]
    line("odometry", by_truth, "deg")
    moved = []
    for time_s in TIMES_S:
        last_s = min(stands[1] - time_s, stands[1])
        starts = np.arange(stands[0], last_s, 0.05)
        axes = [change(receiver_s, places[:, axis], starts, time_s) for axis in (0, 1)]
        moved.append(rms(np.concatenate(axes)) if starts.size else np.nan)
    line("standing", moved, "m")


main()
