"""Compares the pose graph with GTSAM on g2o files: cost and time from the same poses, those in the file.

    python3 -m pip install gtsam
    cargo build --release --manifest-path research/Cargo.toml -p gyre-lab --example solve_g2o
    python3 research/lab/compare_gtsam.py research/target/release/examples/solve_g2o intel.g2o mit.g2o M3500.g2o

Prints a line a file and method: half the sum of squared normalised errors at the solution, iterations, and the median and the least
time of `--repeat` solutions in ms. Each program's cost is its own: an error is the difference of x, y and yaw in Gyre, as in g2o, and
its logarithm in GTSAM. Where yaws fit to a few degrees both are the same. The programs take turns, so that other load meets both.
GTSAM runs with its defaults; where its Cholesky factorisation fails, so does the method.
"""

import argparse
import statistics
import subprocess
import time
from pathlib import Path

import gtsam
import numpy as np

METHODS = {
    "GTSAM Levenberg-Marquardt": (gtsam.LevenbergMarquardtOptimizer, gtsam.LevenbergMarquardtParams, None),
    "GTSAM Gauss-Newton": (gtsam.GaussNewtonOptimizer, gtsam.GaussNewtonParams, None),
    "GTSAM dogleg, QR": (gtsam.DoglegOptimizer, gtsam.DoglegParams, "MULTIFRONTAL_QR"),
}


def load(path):
    """Returns the factors of a file, with its first pose held, and its poses."""
    factors, poses = gtsam.readG2o(str(path), False)
    graph = gtsam.NonlinearFactorGraph(factors)
    first = min(poses.keys())
    noise = gtsam.noiseModel.Diagonal.Sigmas(np.full(3, 1e-4))
    graph.add(gtsam.PriorFactorPose2(first, poses.atPose2(first), noise))
    return graph, poses


def solve_gtsam(graph, poses, method):
    """Returns cost, iterations and time in ms; None if the method fails."""
    optimizer, parameters, solver = method
    parameters = parameters()
    if solver:
        parameters.setLinearSolverType(solver)
    try:
        began = time.perf_counter()
        run = optimizer(graph, poses, parameters)
        solved = run.optimize()
        took_ms = 1e3 * (time.perf_counter() - began)
    except RuntimeError:
        return None
    return graph.error(solved), run.iterations(), took_ms


def solve_gyre(program, path):
    """Returns cost, iterations and time in ms."""
    line = subprocess.run([program, path], check=True, capture_output=True, text=True).stdout.split()
    cost, iterations, took_ms = (line[line.index(name) + 1] for name in ("cost", "iterations", "ms"))
    return float(cost), int(iterations), float(took_ms)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", help="the example solve_g2o, built")
    parser.add_argument("files", nargs="+")
    parser.add_argument("--repeat", type=int, default=15)
    arguments = parser.parse_args()
    for path in arguments.files:
        graph, poses = load(path)
        print(f"{Path(path).name}: {poses.size()} poses, {graph.size() - 1} edges")
        runs = {"Gyre": lambda: solve_gyre(arguments.program, path)}
        for name, method in METHODS.items():
            runs[name] = lambda method=method: solve_gtsam(graph, poses, method)
        rounds = [{name: run() for name, run in runs.items()} for _ in range(arguments.repeat)]
        for name in runs:
            results = [results[name] for results in rounds]
            if None in results:
                print(f"  {name:26} fails")
                continue
            cost, iterations, _ = results[0]
            times_ms = [took_ms for _, _, took_ms in results]
            print(
                f"  {name:26} cost {cost:.6g}  iterations {iterations:3}"
                f"  ms {statistics.median(times_ms):.1f} (least {min(times_ms):.1f})"
            )


if __name__ == "__main__":
    main()
