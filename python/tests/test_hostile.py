"""Random mixtures of valid and hostile arguments end in a result or in an exception with a sentence."""

import random
from typing import Any

import gyre
import numpy as np

FLOATS = [0.0, -1.0, 1e-30, 1e30, float("nan"), float("inf"), 0.175, 1000.0, 1e4, 0.25, 10.0]
INTEGERS = [0, -1, 2**63 - 1, -(2**63), 1_700_000_000_000_000_000, 2**70]


def power(dice: random.Random) -> Any:
    shape = (dice.choice([1, 2, 40, 400, 1025]), dice.choice([1, 16, 576]))
    array: Any = np.random.default_rng(dice.randrange(9)).integers(0, 256, shape, dtype=np.uint8)
    return dice.choice([array] * 6 + [array[::-1], array[:, ::2], array.T, array.astype(np.int8)])


def arguments(dice: random.Random, azimuths: int) -> dict[str, Any]:
    """Keywords of a scan that is valid, but for one or two of them in most cases."""
    angles = np.linspace(0, dice.choice([6.28, -6.28, 1e30]), azimuths)
    angles[dice.randrange(azimuths)] = dice.choice(FLOATS)
    step_ns = dice.choice([0, 1, 625_000, 10**10, -1000])
    hostile: dict[str, Any] = {
        "stamp_ns": dice.choice(INTEGERS),
        "range_resolution_m": dice.choice(FLOATS),
        "range_offset_m": dice.choice(FLOATS),
        "doppler_s": dice.choice(FLOATS),
        "sweep_s": dice.choice(FLOATS),
        "azimuth_rad": angles,
        "azimuth_stamp_ns": [1_700_000_000_000_000_000 + step_ns * azimuth for azimuth in range(azimuths)],
        "azimuth_flags": np.full(azimuths, dice.randrange(256), np.uint8),
    }
    valid = {"stamp_ns": 1_700_000_000_000_000_000, "range_resolution_m": 0.175, "sweep_s": 0.25, "clockwise": dice.random() < 0.5}
    return valid | {key: hostile[key] for key in dice.sample(sorted(hostile), dice.choice([0, 0, 1, 1, 2]))}


def test_random_arguments_end_in_a_result_or_a_sentence() -> None:
    dice, odometry, masker, registered = random.Random(1), gyre.Odometry(), gyre.Masker(), 0
    for _ in range(600):
        array = power(dice)
        try:
            scan = gyre.Scan(array, **arguments(dice, array.shape[0]))
            odometry.register(scan)
            masker.mask(scan, velocity=dice.choice([None, (1.0, 0.0, 0.1), tuple(dice.choices(FLOATS, k=3))]))
        except (gyre.Error, TypeError, ValueError, OverflowError) as error:
            assert len(str(error)) > 10
        else:
            registered += 1
    assert 50 < registered < 550
    assert np.isfinite(odometry.trajectory.poses).all()
