import cmath
import math

import numpy as np
import pytest

from gyre_training.drift import drift, segments
from scenes import write


def straight(tmp_path, scans: int, sequence=None):
    """Writes a straight drive of 1 m a scan."""
    pose = np.column_stack([np.arange(float(scans)), np.zeros(scans), np.zeros(scans)])
    return write(tmp_path / "pairs.npy", pose, sequence)


def arc_error(length: int, bias: float) -> float:
    """Returns the end-point error of `length` steps of 1 m that each turn by `bias`, relative to a straight line."""
    return abs(sum(cmath.exp(1j * k * bias) for k in range(length)) - length)


def test_a_constant_yaw_bias_has_the_drift_computed_by_hand(tmp_path):
    scans, bias = straight(tmp_path, 101), math.radians(0.02)
    pairs = scans.pairs(1)
    result = drift(scans, scans.motions(pairs) + [0, 0, bias], pairs)
    # 50 m from scans 0, 4, ... 48; 100 m from scan 0.
    expected = (13 * arc_error(50, bias) / 50 + arc_error(100, bias) / 100) / 14
    assert result.translation_percent == pytest.approx(100 * expected)
    assert result.rotation_deg_per_100m == pytest.approx(2.0)
    assert result.pair_deg == pytest.approx(0.02) and result.pair_m == pytest.approx(0.0, abs=1e-12)


def test_a_scale_error_is_its_own_percentage(tmp_path):
    scans = straight(tmp_path, 120)
    pairs = scans.pairs(1)
    result = drift(scans, scans.motions(pairs) * [1.03, 1, 1], pairs)
    assert result.translation_percent == pytest.approx(3.0) and result.rotation_deg_per_100m == 0.0
    assert result.pair_m == pytest.approx(0.03)


def test_segments_do_not_cross_sequences(tmp_path):
    # 60 m and 60 m: no segment of 100 m, and the jump between the two does not count.
    scans = straight(tmp_path, 122, sequence=[0] * 61 + [1] * 61)
    pairs = scans.pairs(1)
    assert len(pairs) == 120
    found = scans.motions(pairs)
    found[60:] *= [1.1, 1, 1]
    assert drift(scans, found, pairs).translation_percent == pytest.approx(5.0)  # the mean of 0 and 10 %


def test_a_drive_shorter_than_any_segment_has_no_drift(tmp_path):
    scans = straight(tmp_path, 20)
    pairs = scans.pairs(1)
    result = drift(scans, scans.motions(pairs), pairs)
    assert math.isnan(result.translation_percent) and result.pair_m == 0.0


def test_a_drift_has_plain_floats_for_checkpoints(tmp_path):
    scans = straight(tmp_path, 60)
    pairs = scans.pairs(1)
    result = drift(scans, scans.motions(pairs), pairs)
    assert all(type(value) is float for value in vars(result).values())


def test_segments_of_each_length_start_at_every_fourth_scan():
    true = np.column_stack([np.arange(151.0), np.zeros(151), np.zeros(151)])
    assert len(segments(true, true)) == 26 + 13 + 1  # 50, 100 and 150 m
