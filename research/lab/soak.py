#!/usr/bin/env python3
"""Watches the memory, the descriptors, the shared memory and the logs of a long run, and draws them.

    python3 -m pip install matplotlib
    cargo build --release
    research/lab/soak.py --samples out/soak.csv --plot out/soak.svg -- target/release/gyre run configs/CONFIGURATION --out out/soak

Prints for each process and quantity the value after the first minute, at the end, and the largest since then, and what
`summary.json` says about dropped scans. `--draw-only` draws earlier samples again.
"""

import argparse
import csv
import json
import signal
import subprocess
import sys
import time
from pathlib import Path

INTERVAL_S = 5
SETTLED_S = 60


def stage_of(process):
    """The name of the stage that a process runs, from its command line."""
    words = Path(f"/proc/{process}/cmdline").read_text().split("\0")
    return words[2] if words[1] == "stage" else words[1]


def family(process):
    """A process and all that descend from it."""
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    return [process] + [member for child in children for member in family(int(child))]


def resident_kb(process):
    """Memory of its own and memory shared with other processes, kB."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    values = dict(line.split(":", 1) for line in lines)
    return int(values["RssAnon"].split()[0]), int(values["RssShmem"].split()[0])


def size(files):
    """Space of some files, bytes."""
    return sum(file.stat().st_blocks * 512 for file in files if file.is_file())


def shared_memory(out):
    """The files in shared memory of the run that writes to `out`."""
    for manifest in Path("/dev/shm").glob("gyre-*/*/manifest.json"):
        run = json.loads(manifest.read_text())
        if run["out"] == str(out.resolve()):
            yield from Path("/dev/shm").glob(run["prefix"] + "*")


def sample(run, out):
    """Rows of (process, quantity, value) at this moment."""
    for process in family(run):
        name = stage_of(process)
        own, shared = resident_kb(process)
        yield name, "own memory, MB", own / 1024
        yield name, "shared memory in use, MB", shared / 1024
        yield name, "descriptors", len(list(Path(f"/proc/{process}/fd").iterdir()))
    yield "all", "/dev/shm, MB", size(shared_memory(out)) / 2**20
    yield "all", "logs, kB", size((out / "log").iterdir()) / 1024


def watch(command, out, samples):
    run = subprocess.Popen(command)
    signal.signal(signal.SIGINT, lambda *_: run.send_signal(signal.SIGINT))
    start = time.monotonic()
    with open(samples, "w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["time_s", "process", "quantity", "value"])
        while run.poll() is None:
            time_s = round(time.monotonic() - start, 1)
            try:
                rows.writerows([time_s, *row] for row in sample(run.pid, out))
            except (FileNotFoundError, ProcessLookupError, KeyError, IndexError, json.JSONDecodeError):
                pass  # A process that begins or ends: the next sample has it.
            file.flush()
            time.sleep(INTERVAL_S)
    return run.returncode


def read(samples):
    """Series of (time_s, value) by quantity and process."""
    series = {}
    with open(samples, newline="") as file:
        for row in csv.DictReader(file):
            of_quantity = series.setdefault(row["quantity"], {})
            of_quantity.setdefault(row["process"], []).append((float(row["time_s"]), float(row["value"])))
    return series


def report(series):
    print(f"{'':26}{'':22}{'after 1 min':>12}{'at the end':>12}{'largest':>12}")
    for quantity, processes in series.items():
        for process, points in processes.items():
            settled = [value for time_s, value in points if time_s >= SETTLED_S]
            if settled:
                print(f"{quantity:26}{process:22}{settled[0]:12.2f}{settled[-1]:12.2f}{max(settled):12.2f}")


def draw(series, plot):
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(len(series), 1, sharex=True, figsize=(9, 2.2 * len(series)), layout="constrained")
    for axis, (quantity, processes) in zip(axes, series.items()):
        for process, points in processes.items():
            times, values = zip(*points)
            axis.plot([time_s / 60 for time_s in times], values, label=process, linewidth=1)
        axis.set_ylabel(quantity)
        axis.set_ylim(bottom=0)
        axis.grid(alpha=0.3)
    axes[0].legend(ncols=3, fontsize="small")
    axes[-1].set_xlabel("time, min")
    figure.savefig(plot)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--samples", type=Path, required=True)
    arguments.add_argument("--plot", type=Path, required=True)
    arguments.add_argument("--draw-only", action="store_true")
    arguments.add_argument("command", nargs="*", help="a `gyre run` with --out")
    arguments = arguments.parse_args()
    if not arguments.draw_only:
        out = Path(arguments.command[arguments.command.index("--out") + 1])
        if status := watch(arguments.command, out, arguments.samples):
            return status
        counts = json.loads((out / "summary.json").read_text())
        print(json.dumps({key: value for key, value in counts.items() if not isinstance(value, (dict, list))}, indent=1))
    series = read(arguments.samples)
    report(series)
    draw(series, arguments.plot)
    return 0


if __name__ == "__main__":
    sys.exit(main())
