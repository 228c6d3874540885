#!/usr/bin/env python3
"""Computes a batch of drives under Ray: ray-batch.py LIST OUT [options of gyre batch].

Each task of Ray computes its share of the list on some computer of the cluster; list, recordings and OUT are on a file system that all of them
see. A task that is lost is started again and goes on where it was.
"""

import subprocess
import sys

import ray

TASKS = 16
# Ray counts processors and does not bind to them.
PROCESSORS = 2


@ray.remote(num_cpus=PROCESSORS, max_retries=3)
def compute(index: int, batch: list[str]) -> int:
    """Computes the drives of a task. Their failures are in the table, so its exit code is 1 then."""
    share = ["--jobs", str(PROCESSORS), "--task", str(index), "--tasks", str(TASKS)]
    return subprocess.run([*batch, *share], check=False).returncode


def main() -> int:
    """Shares the drives out, waits, and makes the table."""
    drives, out, *options = sys.argv[1:]
    batch = ["gyre", "batch", drives, "--out", out, *options]
    ray.init()
    ray.get([compute.remote(index, batch) for index in range(TASKS)])
    return subprocess.run([*batch, "--collect"], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
