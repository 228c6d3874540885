#!/usr/bin/env python3
"""Measures what eight observers cost a run: pairs of runs, without and with them, in turn.

    cargo build --release
    lab/observers.py target/release/gyre configs/radiate.toml --data FOLDER [--rate 4] [--pairs 7]

Of the eight observers two look on, two are stopped, two are killed, and two places are for ones that come and go during the whole
run. Prints the median of each figure without and with observers, and asserts that `odometry.csv` is the same.
"""

import argparse
import json
import os
import signal
import statistics
import subprocess
import tempfile
import threading
import time
from pathlib import Path

LOOKING_ON = ["scan", "pose"]
STOPPED = ["masked", "pose"]
KILLED = ["scan", "motion"]
COMING_AND_GOING = ["masked", "refined"]
STAY_S = 0.25


class Watch:
    """A `gyre watch` process."""

    def __init__(self, gyre, out, topic):
        self.process = subprocess.Popen([gyre, "watch", out, topic], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)

    def first_line(self):
        self.process.stdout.readline()
        # The rest is read by nobody: the observer sleeps when the pipe is full, as a slow one.
        return self

    def look_on(self):
        threading.Thread(target=self.process.stdout.read, daemon=True).start()
        return self

    def send(self, number):
        if self.process.poll() is None:
            os.kill(self.process.pid, number)

    def end(self):
        self.process.kill()
        self.process.wait()


def come_and_go(gyre, out, over):
    while not over.is_set():
        guests = [Watch(gyre, out, topic).look_on() for topic in COMING_AND_GOING]
        over.wait(STAY_S)
        for guest in guests:
            guest.end()


def run(command, gyre, observed):
    """Returns the figures of a run and its `odometry.csv`."""
    with tempfile.TemporaryDirectory(prefix="gyre-observers-") as folder:
        out = str(Path(folder) / "out")
        process = subprocess.Popen([*command, "--out", out], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        watches, over = [], threading.Event()
        guests = threading.Thread(target=come_and_go, args=(gyre, out, over))
        if observed:
            while not (Path(out) / "journal" / "poses.journal").exists():
                assert process.poll() is None, "the run ended at once"
                time.sleep(0.01)
            watches = [Watch(gyre, out, topic).first_line().look_on() for topic in LOOKING_ON]
            for number, topics in [(signal.SIGSTOP, STOPPED), (signal.SIGKILL, KILLED)]:
                for topic in topics:
                    watches.append(Watch(gyre, out, topic).first_line())
                    watches[-1].send(number)
            guests.start()
        assert process.wait() == 0, "the run failed"
        over.set()
        for watch in watches:
            watch.end()
        if observed:
            guests.join()
        summary = json.loads((Path(out) / "summary.json").read_text())
        return figures(summary), (Path(out) / "odometry.csv").read_bytes()


def figures(summary):
    latency = summary["latency"]["sensor_to_pose"]
    stages = summary["latency"]["stages"].items()
    of = {f"{stage}, transport, p50 [us]": times["transport"]["p50_us"] for stage, times in stages if "transport" in times}
    return {
        "scans/s": summary["scans_per_s"],
        "sensor to pose, p50 [ms]": latency["p50_us"] / 1e3,
        "sensor to pose, p99 [ms]": latency["p99_us"] / 1e3,
        **of,
    }


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("gyre")
    arguments.add_argument("configuration")
    arguments.add_argument("--data")
    arguments.add_argument("--rate", default="max")
    arguments.add_argument("--pairs", type=int, default=7)
    arguments.add_argument("--set", action="append", default=[])
    given = arguments.parse_args()
    command = [given.gyre, "run", given.configuration, "--rate", given.rate]
    command += ["--data", given.data] if given.data else []
    command += [word for key in given.set for word in ("--set", key)]
    without, with_observers, results = [], [], set()
    for pair in range(given.pairs):
        for observed in [False, True] if pair % 2 == 0 else [True, False]:
            measured, odometry = run(command, given.gyre, observed)
            (with_observers if observed else without).append(measured)
            results.add(odometry)
    assert len(results) == 1, "odometry.csv differs"
    print(f"{'median of ' + str(given.pairs) + ' pairs':<48}{'without':>10}{'with 8':>10}{'change':>10}")
    for name in without[0]:
        before, after = (statistics.median(run[name] for run in runs) for runs in (without, with_observers))
        print(f"{name:<48}{before:>10.2f}{after:>10.2f}{after / before - 1:>10.1%}")


if __name__ == "__main__":
    main()
