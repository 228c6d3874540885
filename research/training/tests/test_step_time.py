import csv

import pytest
import torch

from gyre_training.plots import step_times, training_log
from gyre_training.step_time import METHODS, Measurement, Memory, Setting, against, compare, summary, table


def test_freed_memory_counts_in_the_peak():
    memory = Memory("cpu")
    taken = b"\1" * (64 << 20)
    del taken
    assert 63 < memory.peak() < 80


def test_methods_are_measured_and_one_above_the_limit_does_not_fit():
    settings = [Setting(method, 67, 2, True, "cpu", 1) for method in METHODS]
    fast, slow, near = compare(settings, steps=2, limit_mib=60.0)
    assert fast.fits and fast.step_s > 0 and 2 < fast.memory_mib < 60
    assert not slow.fits and slow.step_s is None and slow.memory_mib >= 60
    # At this size fast and near differ by less than the noise of the resident memory.
    assert fast.memory_mib < slow.memory_mib and near.memory_mib < slow.memory_mib


def test_a_method_whose_later_steps_pass_the_limit_does_not_fit():
    setting = Setting("mbym", 67, 2, True, "cpu", 1)
    assert summary(setting, (0.2, 55.0), [(0.1, 101.0), (0.1, 101.0)], 60.0) == Measurement("mbym", 2, False, None, 101.0)
    assert summary(setting, (0.2, 55.0), [(0.1, 58.0), (0.1, 58.0)], 60.0) == Measurement("mbym", 2, True, 0.1, 58.0)


def test_a_process_that_fails_for_another_reason_is_an_error():
    with pytest.raises(RuntimeError, match="n=63"):
        # The deepest level of 63 cells has one cell: a batch of 1 has no variance.
        compare([Setting("f-mbym", 63, 1, False, "cpu", 1)], steps=1, limit_mib=1e6)


MEASURED = [
    *(Measurement("f-mbym", b, True, 0.1 * b, 70.0 * b) for b in (1, 2, 4, 8, 16, 32)),
    Measurement("f-mbym", 64, False),
    *(Measurement("mbym", b, True, 0.6 * b, 560.0 * b) for b in (1, 2, 4)),
    Measurement("mbym", 8, False, None, 4500.0),
]


def test_ratios_are_of_equal_batches_and_of_the_largest_that_fit():
    cells = {(one.batch, one.method): one for one in MEASURED}
    line = against(cells, "mbym")
    assert "8 times the batch (32 to 4)" in line and "6.0 (1), 6.0 (2), 6.0 (4)" in line and "8.0 (4)" in line
    assert "fits no batch" in against(cells, "mbym-near")
    assert "passed: 4500 MiB" in table(MEASURED, 4096.0)


def test_plots_are_deterministic(tmp_path):
    for name in ("a.svg", "b.svg"):
        step_times(MEASURED, 4096.0, tmp_path / name)
    first = (tmp_path / "a.svg").read_text()
    assert first == (tmp_path / "b.svg").read_text()
    assert all(word in first for word in ("f-mbym", "peak memory, GiB", "training step, s"))


def test_a_log_is_plotted_with_the_best_epoch(tmp_path):
    rows = [{"epoch": k, "step": 10 * (k + 1), "loss": 1 / (k + 1), "translation_percent": t, "rotation_deg_per_100m": 1.0, "learning_rate": 1e-3}
            for k, t in enumerate((2.0, 3.0, 4.0))]
    torch.save({"step": 20}, tmp_path / "best.pt")
    with (tmp_path / "log.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    drawn = training_log(tmp_path).read_text()
    assert all(word in drawn for word in ("epoch 1 is kept", "validation drift", "learning rate"))
