#!/usr/bin/env python3
"""Measures what becomes of a simulated drive on which the radar is blind for a while: by radar alone, with a gyro, with both.

    cargo build --release
    cargo build --release --manifest-path research/Cargo.toml -p gyre-worlds
    research/lab/blind.py target/release/gyre --seeds 1 2 3 4 [--blind-s 10] [--from-s 60] [--realism road] [--profile asm330lhh] [--out out/blind]

The radome is blocked (`simulation.weather`, 100 dB) from `--from-s` on, for `--blind-s`. Each drive is simulated once, and
registered three times. Prints for each drive the error of the displacement from the last scan before to the second after, over the
distance that was driven between; and the NEES of the poses of the scans between against the last one before, over three. Without
`--miscalibrated` the simulated radar's range is exact, and `refinement.scale_sigma` zero: what is measured is the time without it.
"""

import argparse
import csv
import json
import math
import statistics
import subprocess
from pathlib import Path

import numpy as np

VARIANTS = {
    "radar alone": [],
    "gyro": ["gyro.kind=auto"],
    "gyro and wheels": ["gyro.kind=auto", "wheels.kind=auto"],
}


def settings(values):
    return [word for value in values for word in ("--set", value)]


def simulate(arguments, seed, out):
    """Writes a drive as a recording, with the logs of a gyro and of wheels."""
    values = [
        f"simulation.realism={arguments.realism}",
        f"simulation.seed={seed}",
        "simulation.drive.kind=town",
        f"simulation.drive.speed_mps={arguments.speed_mps}",
        "simulation.drive.length_m=4000",
        f"simulation.gyro.profile={arguments.profile}",
        "simulation.wheels.rate_hz=50",
        f"simulation.weather=[{{ from_s = {arguments.from_s}, blocked_db = 100.0 }}, {{ from_s = {arguments.from_s + arguments.blind_s} }}]",
        f"simulation.effects.miscalibration={str(arguments.miscalibrated).lower()}",
        *arguments.set_simulation,
    ]
    scans = int(4 * (arguments.from_s + arguments.blind_s + arguments.after_s))
    command = [arguments.worlds, arguments.config, "--out", out, "--scans", str(scans), *settings(values)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def register(arguments, recording, out, values):
    exact = [] if arguments.miscalibrated else ["refinement.scale_sigma=0"]
    values = ["slam.kind=none", *exact, *values, *arguments.set]
    command = [arguments.gyre, "run", arguments.config, recording, "--out", out, "--fresh", "--rate", "max", *settings(values)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def motions(out):
    with open(out / "odometry.csv") as file:
        return list(csv.DictReader(file))


def truth(recording):
    """Poses by their stamps, in units of 10 us."""
    poses = {}
    for line in (recording / "ground_truth.tum").read_text().splitlines():
        words = [float(word) for word in line.split()] if not line.startswith("#") else []
        if words:
            poses[round(words[0] * 1e5)] = np.array([words[1], words[2], 2 * math.atan2(words[6], words[7])])
    return poses


def rotation(yaw):
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])


def then(a, b):
    return a + rotation(a[2]) @ b


def between(a, b):
    moved = rotation(-a[2]) @ (b - a)
    moved[2] = math.remainder(b[2] - a[2], math.tau)
    return moved


def matrix(row):
    xx, xy, xw, yy, yw, ww = (float(row[f"cov_{key}"]) for key in ("xx", "xy", "xyaw", "yy", "yyaw", "yawyaw"))
    return np.array([[xx, xy, xw], [xy, yy, yw], [xw, yw, ww]])


def composed(rows):
    """The pose and its covariance after each motion, as `ComposedMotion` in shared/geometry."""
    at, drift = np.zeros(3), np.zeros((3, 3))
    for k, row in enumerate(rows):
        share, covariance = float(row["drift_share"]), matrix(row)
        noise = 0.5 * (1 - share) * covariance
        if k == 0:
            drift = noise.copy()
        motion = np.array([float(row["x_m"]), float(row["y_m"]), float(row["yaw_rad"])])
        turn = rotation(at[2])
        moved = turn @ motion
        lever = np.eye(3)
        lever[0, 2], lever[1, 2] = -moved[1], moved[0]
        drift = lever @ drift @ lever.T + turn @ (share * covariance) @ turn.T
        at = then(at, motion)
        scale = float(row["scale_sigma"]) * np.array([at[0], at[1], 0])
        yield at, drift + turn @ noise @ turn.T + np.outer(scale, scale)


def measure(arguments, recording, out):
    rows, poses = motions(out), truth(recording)
    stamps = [round(int(row["stamp_ns"]) / 1e4) for row in rows]
    start = min(poses)
    blind = [k for k, stamp in enumerate(stamps) if arguments.from_s + 0.2 < (stamp - start) * 1e-5 < arguments.from_s + arguments.blind_s]
    first, last = blind[0], min(blind[-1] + 3, len(rows) - 1)
    reference = poses[stamps[first - 1]]
    driven, nees = 0.0, []
    for k, (at, covariance) in zip(range(first, last + 1), composed(rows[first : last + 1])):
        here, before = poses[stamps[k]], poses[stamps[k - 1]]
        driven += math.hypot(*(here - before)[:2])
        off = at - between(reference, here)
        off[2] = math.remainder(off[2], math.tau)
        nees.append(float(off @ np.linalg.solve(covariance, off)) / 3)
    outcomes = [row["outcome"] for row in rows[first : last + 1]]
    # From there on a jump would show.
    after = between(poses[stamps[last - 1]], poses[stamps[last]])
    jump = np.array([float(rows[last]["x_m"]), float(rows[last]["y_m"])]) - after[:2]
    return {
        "driven_m": driven,
        "end_m": math.hypot(off[0], off[1]),
        "along_m": off[0],
        "yaw_deg": math.degrees(off[2]),
        "share": math.hypot(off[0], off[1]) / max(driven, 1e-9),
        "nees": statistics.mean(nees),
        "nees_end": nees[-1],
        "jump_m": float(np.hypot(*jump)),
        "predicted": outcomes.count("predicted"),
        "scans": len(outcomes),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("gyre")
    parser.add_argument("--worlds", default="research/target/release/gyre-worlds", help="the program that simulates")
    parser.add_argument("--config", default="configs/demo.toml")
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3, 4])
    parser.add_argument("--blind-s", type=float, default=10.0)
    parser.add_argument("--from-s", type=float, default=60.0)
    parser.add_argument("--after-s", type=float, default=5.0)
    parser.add_argument("--speed-mps", type=float, default=10.0)
    parser.add_argument("--realism", default="plain")
    parser.add_argument("--profile", default="asm330lhh")
    parser.add_argument("--miscalibrated", action="store_true")
    parser.add_argument("--variants", nargs="+", default=list(VARIANTS))
    parser.add_argument("--set", nargs="*", default=[], help="settings of the runs")
    parser.add_argument("--set-simulation", nargs="*", default=[], help="settings of the simulation")
    parser.add_argument("--out", type=Path, default=Path("out/blind"))
    arguments = parser.parse_args()
    results = {name: [] for name in arguments.variants}
    for seed in arguments.seeds:
        recording = arguments.out / f"{arguments.realism}-{seed}"
        simulate(arguments, seed, recording)
        for name in arguments.variants:
            out = arguments.out / f"{arguments.realism}-{seed}-{name.replace(' ', '-')}"
            register(arguments, recording, out, VARIANTS[name])
            result = measure(arguments, recording, out)
            results[name].append(result)
            print(json.dumps({"seed": seed, "with": name, **{key: round(value, 4) for key, value in result.items()}}), flush=True)
    for name, all_of in results.items():
        shares = [100 * result["share"] for result in all_of]
        nees = statistics.mean(result["nees"] for result in all_of)
        print(f"{name}: end error {statistics.median(shares):.2f} % (worst {max(shares):.2f} %) of the distance, NEES {nees:.2f}")


if __name__ == "__main__":
    main()
