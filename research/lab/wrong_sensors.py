#!/usr/bin/env python3
"""Spoils the logs of gyro and wheels of two simulated drives, and prints what a run makes of each: exit code, ATE, rotation, counts.

    cargo build --release
    cargo build --release --manifest-path research/Cargo.toml -p gyre-worlds
    research/lab/wrong_sensors.py target/release/gyre [CASE...] [--out out/wrong-sensors]

A wrong sensor must end the run with exit code 1 and the key that corrects it; bursts and missing samples are left out and counted.
"""

import argparse
import csv
import json
import random
import re
import subprocess
from pathlib import Path

DRIVES = {
    "winding": 'seed=1 drive={ kind = "town", keep = "right", length_m = 900.0 }',
    "straight": 'seed=11 drive={ kind = "block", keep = "right", block_length_m = 400.0, block_width_m = 300.0, speed_mps = 11.0 }',
}


def late(seconds):
    return lambda rows: [[row[0] + int(seconds * 1e9), *row[1:]] for row in rows]


def scaled(factor):
    # The accelerations of a gyro stay.
    return lambda rows: [[row[0], *[value * factor for value in row[1:4]], *row[4:]] for row in rows]


def turned_round(rows):
    return [[*row[:3], -row[3], *row[4:]] for row in rows]


def for_yaw(axis):
    return lambda rows: [[row[0], row[2], row[3], row[axis], *row[4:]] for row in rows]


def bursts(size):
    def spoil(rows):
        numbers, rows = random.Random(5), [list(row) for row in rows]
        for _ in range(20):
            first = numbers.randrange(len(rows) - 20)
            for row in rows[first : first + 12]:
                row[3 if len(row) > 3 else 1] += size
        return rows

    return spoil


def half(rows):
    return rows[: len(rows) // 2]


def every_second_second(rows):
    return [row for row in rows if (row[0] - rows[0][0]) // 10**9 % 2 == 0]


def cases(delays, scales, burst, others):
    return {
        "right": lambda rows: rows,
        **{f"late {it} s": late(it) for it in delays},
        **{f"scale {it}": scaled(it) for it in scales},
        **others,
        "bursts": bursts(burst),
        "second half missing": half,
        "every second second missing": every_second_second,
    }


AXES = {"yaw turned round": turned_round, "x for yaw": for_yaw(1), "y for yaw": for_yaw(2)}
SENSORS = {
    "gyro": ("imu.csv", cases([0.1, 0.2, 0.3, 0.5, 1.0, 2.0], [0.5, 0.8, 0.9, 1.1, 1.25, 2.0], 0.6, AXES)),
    "wheels": ("wheels.csv", cases([0.3, 0.5, 1.0, 2.0], [0.5, 0.8, 0.9, 1.1, 1.25, 2.0, -1.0], 4.0, {})),
}


def simulate(worlds, drive, out):
    common = 'scans=220 realism="road" gyro.profile="asm330lhh" wheels.rate_hz=50.0'
    seed, route = DRIVES[drive].split(" ", 1)
    settings = "\n".join([*common.split(), seed, route]).replace("=", " = ")
    config = out / f"{drive}.toml"
    config.write_text(f"[simulation]\n{settings}\n")
    subprocess.run([worlds, config, "--out", out / drive], check=True, stdout=subprocess.DEVNULL)


def spoil(log, into, change):
    with open(log, newline="") as file:
        header, *rows = csv.reader(file)
    rows = change([[int(row[0]), *map(float, row[1:])] for row in rows])
    with open(into, "w", newline="") as file:
        csv.writer(file).writerows([header, *rows])


def run(gyre, recording, sensor, log, out):
    settings = ["slam.kind=none", f"{sensor}.kind=log", f"{sensor}.file={log}"]
    words = [word for setting in settings for word in ("--set", setting)]
    command = [gyre, "run", "configs/demo.toml", recording, "--out", out, "--fresh", *words]
    ran = subprocess.run(command, capture_output=True, text=True)
    text = ran.stdout + ran.stderr
    figure = lambda pattern: (re.search(pattern, text) or [None, "-"])[1]
    counts = json.loads((out / "summary.json").read_text()).get(sensor) if (out / "summary.json").exists() else None
    reason = next((line for line in text.splitlines() if "contradict" in line), "")
    return [ran.returncode, figure(r"ATE +([\d.]+)"), figure(r"([\d.]+) deg/100"), counts, reason]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("gyre")
    parser.add_argument("cases", nargs="*")
    parser.add_argument("--worlds", default="research/target/release/gyre-worlds")
    parser.add_argument("--out", type=Path, default=Path("out/wrong-sensors"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for drive in DRIVES:
        simulate(arguments.worlds, drive, arguments.out)
        for sensor, (log, changes) in SENSORS.items():
            for name, change in changes.items():
                if arguments.cases and name not in arguments.cases:
                    continue
                spoilt = arguments.out.absolute() / f"spoilt-{log}"
                spoil(arguments.out / drive / log, spoilt, change)
                found = run(arguments.gyre, arguments.out / drive, sensor, spoilt, arguments.out / "run")
                print(f"| {drive} | {sensor} | {name} |", " | ".join(map(str, found)), "|", flush=True)


if __name__ == "__main__":
    main()
