#!/usr/bin/env python3
"""Compares simulated scans with real ones: statistics of each recording, and a distance for each statistic.

    pip install ./python && cargo build --release
    research/lab/realism.py SIMULATED REAL --between ANOTHER --out out/realism

The statistics are in research/lab/rows/realism.toml. Sensors differ in resolution and range, so all that is compared is measured on one grid
of range, the coarsest and shortest of the recordings'. Lengths, shares and errors are compared by the magnitude of the natural
logarithm of their ratio: 0.1 is a tenth more or less, 0.69 twice or half. The searches are run by the program `gyre`.
"""

import argparse
import cmath
import csv
import itertools
import json
import math
import os
import platform
import re
import shlex
import subprocess
import sys
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

import gyre
import numpy as np
from scan_statistics import Failure, Sample, change, common_grid, histogram, mean_power, percentile, resample, statistics, wasserstein

ROOT = Path(__file__).resolve().parents[2]
# The rows of research/lab/rows/table-iii.toml whose searches are run, the refined one last: their trajectory
# aligns scans without a truth.
SEARCHES = {"plain": "f-raw, line 14", "alone": "Gyre, search alone", "refined": "Gyre"}
# Consecutive scans that are measured in a row.
RUN = 8
# A recording with fewer scans is not halved.
MIN_HALVED = 6
# A motion that rotates by more than this is one in a turn.
TURNING_DEG = 2.0
# A trajectory is not interpolated across wider gaps, as in `gyre evaluate`; files round stamps by
# less than the latter.
MAX_GAP_NS, ROUNDING_NS = 1_000_000_000, 1_000_000

COLUMNS = {
    "statistic": "statistic", "sim": "sim", "real": "real", "other": "other", "distance": "distance", "within_real": "within real",
    "sim_real": "sim-real", "real_other": "real-other", "within_other": "within other", "verdict": "sim is",
}


def wrapped(angle_rad):
    return math.remainder(angle_rad, math.tau)


def pose(trajectory, stamp_ns):
    """The pose (a complex position, a yaw) at a time; None before the first, after the last, and in gaps."""
    stamps, poses = trajectory.stamp_ns, trajectory.poses
    within_ns = int(np.clip(stamp_ns, stamps[0], stamps[-1]))
    if abs(within_ns - stamp_ns) > ROUNDING_NS:
        return None
    after = int(np.searchsorted(stamps, within_ns))
    x_m, y_m, yaw_rad = poses[after]
    if stamps[after] != within_ns:
        gap_ns = int(stamps[after] - stamps[after - 1])
        if gap_ns > MAX_GAP_NS:
            return None
        share, before = (within_ns - int(stamps[after - 1])) / gap_ns, poses[after - 1]
        x_m, y_m = before[:2] * (1.0 - share) + poses[after][:2] * share
        yaw_rad = before[2] + share * wrapped(yaw_rad - before[2])
    return complex(x_m, y_m), yaw_rad


def motion_between(trajectory, from_ns, to_ns):
    """The pose at `to_ns` in the frame of that at `from_ns`; None where one of them is not known."""
    if trajectory is None or from_ns is None:
        return None
    start, end = pose(trajectory, from_ns), pose(trajectory, to_ns)
    if start is None or end is None:
        return None
    return (end[0] - start[0]) * cmath.exp(-1j * start[1]), wrapped(end[1] - start[1])


def runs(scans, most):
    """At most `most` of so many scans, in ranges of consecutive ones, evenly spread."""
    if scans <= most:
        return [range(scans)]
    length = min(RUN, most)
    count = most // length
    starts = [run * (scans - length) // max(count - 1, 1) for run in range(count)]
    return [range(start, start + length) for start in starts]


class Recording:
    """A recording that was named on the command line, as its configuration plays it."""

    def __init__(self, role, data, file, configs):
        self.role, self.data = role, data
        self.file = file or configs / f"{gyre.open(data).format}.toml"
        self.dataset = gyre.open(data, gyre.Config.read(self.file))
        table = tomllib.loads(self.file.read_text())
        source = table.get("source", {})
        first = min(max(source.get("first", 0), self.dataset.first), len(self.dataset))
        self.played = range(first, min(first + source.get("scans", len(self.dataset)), len(self.dataset)))
        truth = table.get("run", {}).get("ground_truth") or gyre.find_ground_truth(data)
        truth = gyre.Trajectory.read(truth) if truth else None
        # Without times or headings it gives no motions.
        self.truth = truth if truth and truth.stamp_ns is not None and len(truth) and np.ptp(truth.poses[:, 2]) else None
        self.odometry, self.searches = None, {}

    def read(self, index):
        """A scan; says so and returns None where it cannot be read."""
        try:
            return self.dataset[index]
        except gyre.ReadError as error:
            print(f"left out: {error}", file=sys.stderr)
            return None

    def first_scan(self):
        scan = next(filter(None, map(self.read, self.played)), None)
        if scan is None:
            raise Failure(f"{self.data}: no scan can be read")
        return scan

    def search(self, program, scans, out):
        """Runs the search in the paper's form, and the shipped configuration without refinement and with it, on the first scans."""
        scans = min(len(self.played), scans)
        if scans < 2:
            return
        rows = tomllib.loads((ROOT / "research/lab/rows/table-iii.toml").read_text())
        motions = []
        for search, name in SEARCHES.items():
            row = next(row for row in rows["row"] if row["name"] == name)
            changes = [change for group in row["groups"] for change in rows["groups"][group]] + row.get("set", [])
            folder = out / self.role / "-".join(re.findall("[a-z0-9]+", name.lower()))
            command = [program, "run", self.file, self.data, "--out", folder, "--rate", "max", "--fresh"]
            command += itertools.chain(*(["--set", change] for change in [*changes, f"source.scans={scans}"]))
            if subprocess.run(command, stdout=subprocess.DEVNULL).returncode:
                raise Failure(f"`{shlex.join(map(str, command))}` did not succeed")
            self.searches[search] = json.loads((folder / "summary.json").read_text())["evaluation"]
            self.odometry = gyre.Trajectory.read(folder / "trajectory.tum")
            with open(folder / "odometry.csv", newline="") as file:
                motions.append(list(csv.DictReader(file)))
        self.searches["difference"] = differences(*motions[1:])

    def measure(self, grid, most):
        """The statistics of at most `most` scans of the whole recording, and of each half.

        How far apart the halves are is what a distance owes to chance and to the streets driven.
        """
        played = self.played
        middle = len(played) // 2
        whole = self.measure_part(played, grid, most)
        halves = [self.measure_part(half, grid, most) for half in (played[:middle], played[middle:]) if len(played) >= MIN_HALVED]
        return Measured(whole | self.searches, halves)

    def measure_part(self, scans, grid, most):
        samples, raw = [], np.zeros(256, int)
        for run in runs(len(scans), most):
            before_ns = None
            for scan in map(self.read, scans[run.start : run.stop]):
                if scan is not None:
                    known = (motion_between(track, before_ns, scan.stamp_ns) for track in (self.truth, self.odometry))
                    samples.append(Sample(resample(scan, *grid), next(filter(None, known), None)))
                    raw += histogram([scan])
                before_ns = scan and scan.stamp_ns
        if not samples:
            raise Failure(f"{self.data} has no scan to measure")
        return statistics(samples, raw, grid[0])


def differences(alone, refined):
    """The RMS differences of the motions by two methods on the same scans. They need no truth."""
    a, b = (
        np.array([[float(row[key]) for key in ("x_m", "y_m", "yaw_rad")] for row in rows]).reshape(-1, 3) for rows in (alone, refined)
    )
    count = min(len(a), len(b))
    apart, turning = a[:count] - b[:count], np.abs(np.degrees(b[:count, 2])) > TURNING_DEG
    yaw_deg = np.degrees([wrapped(yaw) for yaw in apart[:, 2]])
    shift_m = np.hypot(apart[:, 0], apart[:, 1])

    def rms(values):
        return math.sqrt(np.mean(values**2)) if len(values) else None

    of_turns = {"straight_deg": rms(yaw_deg[~turning]), "turning_deg": rms(yaw_deg[turning])}
    return {"translation_m": rms(shift_m), "rotation_deg": rms(yaw_deg)} | of_turns


# The comparison.


@dataclass
class Measured:
    """The statistics of a whole recording, and of its halves: none where it has too few scans."""

    whole: dict
    halves: list


def figure(of, key):
    """A figure by its path, as in `plain/rpe/translation_rmse_m`; None where it is not known."""
    for part in key.split("/"):
        of = (of or {}).get(part)
    return of


def shown(row, of):
    """A statistic as it is printed; None where it is not known."""
    match row.get("distance"):
        case "Wasserstein, counts":
            return ", ".join(f"{100 * share:.0f} %: {percentile(of['histogram'], share)}" for share in (0.5, 0.9, 0.99))
        case "RMS, counts":
            return None if of["power_at_10_m"] is None else f"10 m: {of['power_at_10_m']:.1f}"
    value = figure(of, row["figure"])
    return None if value is None else f"{value * row.get('factor', 1.0):.{row.get('decimals', 3)}f}{row.get('unit', '')}"


def between(row, a, b):
    """The distance of two recordings; None where one of them lacks the statistic, or it is not finite."""
    if row.get("distance") == "Wasserstein, counts":
        return wasserstein(a["histogram"], b["histogram"])
    if row.get("distance") == "RMS, counts":
        # Over as much of the range as both have.
        cells = min(len(a["mean_power"]), len(b["mean_power"]))
        return math.sqrt(np.mean((a["mean_power"][:cells] - b["mean_power"][:cells]) ** 2))
    a, b = figure(a, row["figure"]), figure(b, row["figure"])
    if a is None or b is None:
        return None
    if row.get("distance") == "abs. difference":
        return abs(a - b)
    a, b = a + row.get("floor", 0.0), b + row.get("floor", 0.0)
    return abs(math.log(a / b)) if a > 0.0 and b > 0.0 else None


def compared(row, sim, real, other):
    """Compares `sim` with `real`, and `real` with another real recording, by one statistic."""
    sim_real = between(row, sim.whole, real.whole)
    real_other = other and between(row, real.whole, other.whole)
    within_real, within_other = (of and of.halves and between(row, *of.halves) or None for of in (real, other))
    closer = None if sim_real is None or real_other is None else bool(sim_real < real_other)
    # Two real recordings may be closer than halves of one are to each other, by chance.
    chance = [within for within in (within_real, within_other) if within is not None]
    by_chance = closer is False and bool(chance) and sim_real <= max(chance)
    return {
        "statistic": row["name"],
        **{role: of and shown(row, of.whole) for role, of in (("sim", sim), ("real", real), ("other", other))},
        "distance": row.get("distance", "abs. log ratio"),
        "within_real": within_real,
        "sim_real": sim_real,
        "real_other": real_other,
        "within_other": within_other,
        "closer": closer,
        "verdict": {None: None, True: "closer", False: "farther, within chance" if by_chance else "farther"}[closer],
    }


def compare(sim, real, other=None):
    """The rows of the comparison, and what it says at its end."""
    rows = tomllib.loads((ROOT / "research/lab/rows/realism.toml").read_text())["statistic"]
    rows = [compared(row, sim, real, other) for row in rows]
    judged = [row["closer"] for row in rows if row["closer"] is not None]
    return rows, f"\n\ncloser in {sum(judged)} of {len(judged)}" if other else ""


def markdown(rows, legend, command, machine, date):
    """The report. A column that no row knows anything about is left out."""

    def cell(value):
        return "-" if value is None else f"{value:.3f}" if isinstance(value, float) else str(value)

    columns = [key for key in COLUMNS if any(row[key] is not None for row in rows)]
    lines = [f"# realism, gyre {gyre.__version__}", "", f"{machine['processor']}, {machine['cores']} cores; {date}", ""]
    lines += ["```sh", command, "```", "", "## Distances", "", f"| {' | '.join(COLUMNS[key] for key in columns)} |"]
    lines += ["|" + "---|" * len(columns)]
    lines += [f"| {' | '.join(cell(row[key]) for key in columns)} |" for row in rows]
    return "\n".join([*lines, "", legend]) + "\n"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sim", type=Path, help="the simulated recording's folder")
    parser.add_argument("real", type=Path, help="the real recording's folder")
    parser.add_argument(
        "--between", type=Path, metavar="OTHER",
        help="another real recording: says of each statistic whether SIM is closer to REAL than this one is",
    )
    parser.add_argument(
        "--configs", type=Path, default=ROOT / "configs",
        help="the folder of the configurations, oxford.toml and so on: each recording is read by the one of its format",
    )
    for role in ("sim", "real", "between"):
        parser.add_argument(f"--{role}-config", type=Path, metavar="FILE", help=f"{role.upper()}'s configuration instead")
    parser.add_argument(
        "--out", type=Path, default="out/realism", help="the folder of realism.md, realism.json and the runs of the searches"
    )
    parser.add_argument(
        "--scans", type=int, default=64,
        help="scans whose statistics are taken, at most: runs of consecutive ones, evenly spread over the recording",
    )
    parser.add_argument(
        "--search-scans", type=int, default=512, help="scans that the odometries are run on, at most, from the first on; 0: run none"
    )
    parser.add_argument("--gyre", default=ROOT / "target/release/gyre", metavar="PROGRAM", help="the program that runs the searches")
    return parser.parse_args()


def main():
    asked = arguments()
    named = [("sim", asked.sim, asked.sim_config), ("real", asked.real, asked.real_config), ("other", asked.between, asked.between_config)]
    recordings = [Recording(role, data, file, asked.configs) for role, data, file in named if data]
    grid = resolution_m, cells = common_grid([recording.first_scan() for recording in recordings])
    asked.out.mkdir(parents=True, exist_ok=True)
    legend = (
        f"Powers averaged over {resolution_m:.4f} m of range up to {cells * resolution_m:.1f} m, the coarsest and the shortest of the "
        "recordings'; saturation in the sensors' own bins; within: between a recording's halves, and what is no more than that is chance."
    )
    measured = []
    for recording in recordings:
        recording.search(asked.gyre, asked.search_scans, asked.out)
        measured.append(recording.measure(grid, asked.scans))
        whole = measured[-1].whole
        legend += f" {recording.role}: {recording.data}, {whole['scans']} scans, {whole['pairs']} pairs of consecutive ones."
    rows, verdict = compare(*measured)
    command, date = shlex.join(sys.argv), time.strftime("%Y-%m-%d", time.gmtime())
    models = re.findall(r"^model name\s*: (.*)", Path("/proc/cpuinfo").read_text(), re.M)
    machine = {"processor": (models or [platform.machine()])[0], "cores": len(os.sched_getaffinity(0))}
    table = {"title": "Distances", "rows": rows, "legend": legend + verdict}
    report = {"version": gyre.__version__, "machine": machine, "date": date, "command": command, "tables": [table]}
    (asked.out / "realism.json").write_text(json.dumps(report, indent=2))
    text = markdown(rows, table["legend"], command, machine, date)
    (asked.out / "realism.md").write_text(text)
    print(text, end="")


if __name__ == "__main__":
    try:
        main()
    except (gyre.Error, OSError, Failure) as error:
        sys.exit(f"realism: {error}")
