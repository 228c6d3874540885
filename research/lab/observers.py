#!/usr/bin/env python3
"""Measures what eight observers cost a run: pairs of runs, without and with them, in turn.

    cargo build --release
    research/lab/observers.py target/release/gyre configs/radiate.toml --data FOLDER [--rate 4] [--pairs 7] [--only looking]

Of the eight observers two look on, two are stopped, two are killed, and two places are for ones that come and go during the whole
run; `--only` takes one of these kinds alone. Prints the median of each figure without and with observers, and asserts that
`odometry.csv` is the same. Processor times and context switches are those of all processes of the run, and of all observers: unlike
the throughput they hardly depend on what else the machine does.
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
KINDS = ["looking", "stopped", "killed", "guests"]
STAY_S = 0.25


class Watch:
    """A `gyre echo` process."""

    def __init__(self, gyre, out, topic):
        # Its lines go where nobody has to read them.
        self.lines = tempfile.TemporaryFile()
        self.process = subprocess.Popen([gyre, "echo", out, topic], stdout=self.lines, stderr=subprocess.DEVNULL)

    def first_line(self):
        deadline = time.monotonic() + 10.0
        while os.fstat(self.lines.fileno()).st_size == 0 and time.monotonic() < deadline:
            time.sleep(0.005)
        return self

    def send(self, number):
        os.kill(self.process.pid, number)
        return self

    def end(self):
        """Kills it; returns what it has used."""
        # Not by the process itself, which would wait for one that has ended and forget what it has used.
        if self.process.returncode is None:
            os.kill(self.process.pid, signal.SIGKILL)
        return used(self.process)


def used(process):
    """Waits for a process; returns its processor time with that of the children it has waited for, and its context switches."""
    if process.returncode is not None:
        return 0.0, 0
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return usage.ru_utime + usage.ru_stime, usage.ru_nvcsw


def come_and_go(gyre, out, over, spent):
    while not over.is_set():
        guests = [Watch(gyre, out, topic) for topic in COMING_AND_GOING]
        over.wait(STAY_S)
        spent += [guest.end() for guest in guests]


def attach(gyre, out, kinds):
    watches = []
    if "looking" in kinds:
        watches += [Watch(gyre, out, topic).first_line() for topic in LOOKING_ON]
    if "stopped" in kinds:
        watches += [Watch(gyre, out, topic).first_line().send(signal.SIGSTOP) for topic in STOPPED]
    if "killed" in kinds:
        watches += [Watch(gyre, out, topic).first_line().send(signal.SIGKILL) for topic in KILLED]
    return watches


def run(command, gyre, kinds):
    """Returns the figures of a run, observed by these kinds of observers, and its `odometry.csv`."""
    with tempfile.TemporaryDirectory(prefix="gyre-observers-") as folder:
        out = str(Path(folder) / "out")
        process = subprocess.Popen([*command, "--out", out], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        watches, over, spent = [], threading.Event(), []
        guests = threading.Thread(target=come_and_go, args=(gyre, out, over, spent))
        if kinds:
            while not (Path(out) / "journal" / "poses.journal").exists():
                assert process.poll() is None, "the run ended at once"
                time.sleep(0.01)
            watches = attach(gyre, out, kinds)
            if "guests" in kinds:
                guests.start()
        own = used(process)
        assert process.returncode == 0, "the run failed"
        over.set()
        spent += [watch.end() for watch in watches]
        if "guests" in kinds:
            guests.join()
        summary = json.loads((Path(out) / "summary.json").read_text())
        return figures(summary, own, spent), (Path(out) / "odometry.csv").read_bytes()


def figures(summary, own, spent):
    latency = summary["latency"]["sensor_to_pose"]
    stages = summary["latency"]["stages"].items()
    of = {f"{stage}, transport, p50 [us]": times["transport"]["p50_us"] for stage, times in stages if "transport" in times}
    return {
        "scans/s": summary["scans_per_s"],
        "processor time of the run [s]": own[0],
        "processor time of observers [s]": sum(seconds for seconds, _ in spent),
        "context switches of the run": own[1],
        "context switches of observers": sum(switches for _, switches in spent),
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
    arguments.add_argument("--only", choices=KINDS)
    arguments.add_argument("--set", action="append", default=[])
    given = arguments.parse_args()
    command = [given.gyre, "run", given.configuration, "--rate", given.rate]
    command += [given.data] if given.data else []
    command += [word for key in given.set for word in ("--set", key)]
    kinds = [given.only] if given.only else KINDS
    without, with_observers, results = [], [], set()
    for pair in range(given.pairs):
        for observed in [False, True] if pair % 2 == 0 else [True, False]:
            measured, odometry = run(command, given.gyre, kinds if observed else [])
            (with_observers if observed else without).append(measured)
            results.add(odometry)
    assert len(results) == 1, "odometry.csv differs"
    print(f"{'median of ' + str(given.pairs) + ' pairs':<48}{'without':>10}{'with':>10}{'change':>10}")
    for name in without[0]:
        before, after = (statistics.median(run[name] for run in runs) for runs in (without, with_observers))
        change = f"{after / before - 1:>10.1%}" if before else ""
        print(f"{name:<48}{before:>10.2f}{after:>10.2f}{change}")


if __name__ == "__main__":
    main()
