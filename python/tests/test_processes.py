"""Objects that are copied, pickled, and taken into other processes and interpreters."""

import copy
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gyre
import numpy as np
import pytest
from conftest import noise, python, scan


def in_a_forked_process(do: Callable[[], object]) -> str:
    """The exception that something raises in a process that is forked here, or `nothing`."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        said = "nothing"
        try:
            do()
        except BaseException as error:
            said = f"{type(error).__name__}: {error}"
        os.write(writer, said.encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        said = pipe.read().decode()
    assert os.waitpid(child, 0)[1] == 0, "the forked process crashed"
    return said


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of forks in a process that has threads
def test_what_was_made_before_a_fork_is_refused_after_it(recording: Path) -> None:
    odometry, masker = gyre.Odometry(), gyre.Masker()
    slam, dataset = gyre.Slam(gyre.Config({"slam": {"kind": "graph"}})), gyre.open(recording)
    first = dataset[0]
    for name, do in (
        ("Odometry", lambda: odometry.register(first)),
        ("Odometry", lambda: odometry.trajectory),
        ("Masker", lambda: masker.mask(first)),
        ("Slam", lambda: slam.loops),
        ("Dataset", lambda: dataset[1]),
        ("Dataset", lambda: next(iter(dataset))),
    ):
        said = in_a_forked_process(do)
        assert said == f"Error: this {name} was made before the process forked, and cannot be used in the new one: make it there"
        do()
    assert in_a_forked_process(lambda: gyre.Odometry().register(first)) == "nothing"
    assert in_a_forked_process(lambda: gyre.open(recording)[1]) == "nothing"


def test_a_configuration_a_dataset_and_a_trajectory_can_be_pickled(recording: Path) -> None:
    config = gyre.Config.of(recording, {"masking.threshold": 77})
    assert pickle.loads(pickle.dumps(config)) == config == copy.deepcopy(config)
    for dataset in (gyre.open(recording, config), gyre.open(recording)):
        again = pickle.loads(pickle.dumps(dataset))
        assert np.array_equal(again[3].power, dataset[3].power)
        assert again[3].range_offset_m == dataset[3].range_offset_m
    for trajectory in (gyre.Trajectory([1, 2], [[1, 2, 3], [4, 5, -3]]), gyre.Trajectory(None, np.zeros((0, 3)))):
        again = pickle.loads(pickle.dumps(trajectory))
        assert np.allclose(again.poses, trajectory.poses, atol=1e-15)
        assert np.array_equal(np.array(again.stamp_ns), np.array(trajectory.stamp_ns))


def test_what_cannot_be_copied_or_pickled_says_so() -> None:
    odometry = gyre.Odometry()
    registered, masker = odometry.register(scan(noise())), gyre.Masker()
    slam = gyre.Slam(gyre.Config({"slam": {"kind": "graph"}}))
    for thing in (odometry, registered, registered.pose, masker, slam, scan(noise())):
        untyped: Any = copy.copy
        for do in (pickle.dumps, untyped, copy.deepcopy):
            with pytest.raises(TypeError, match="cannot pickle 'gyre"):
                do(thing)


def test_another_interpreter_of_the_process_is_served_or_refused() -> None:
    program = """
try:
    import _interpreters as interpreters
except ImportError:
    import _xxsubinterpreters as interpreters
code = '''
try:
    import gyre
except ImportError as error:
    print("refused:", error)
else:
    print("served:", gyre.Odometry())
'''
interpreters.run_string(interpreters.create(), code)
"""
    done = python("-W", "ignore", "-c", program)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(("refused: ", "served: ")), done.stdout + done.stderr
