from pathlib import Path

import pytest
import torch

from gyre_training import cli
from gyre_training.compare import EverySecond
from gyre_training.network import NetworkConfig
from gyre_training.search import SearchConfig
from gyre_training.train import Trainer, TrainingConfig
from scenes import drive


def test_networks_are_compared_in_floats_and_integers(tmp_path: Path):
    (tmp_path / "pairs").mkdir()
    splits = [drive(tmp_path / "pairs" / f"{split}.npy", 70, seed=seed) for seed, split in enumerate(("train", "test"))]
    for split in ("train", "test"):
        with (tmp_path / "pairs" / f"{split}.toml").open("a") as settings:
            settings.write('[rotation]\npeak = "parabola"\nangles = 60\nband_low = 0.01\nband_high = 0.35\nradii = 10\n[translation]\npeak = "parabola"\noverlap = "none"\nreach_m = 8.0\n')
    for name, network in {"both": NetworkConfig(widths=(4, 8)), "one": NetworkConfig(inputs=1, widths=(8, 16), fold=4)}.items():
        search = SearchConfig(angles=60, radii=10, reach_m=8.0)
        Trainer(tmp_path / name, *splits, network, search, TrainingConfig(batch=2, epochs=1, epoch_pairs=4)).run()
    runs = [str(tmp_path / name) for name in ("both", "one")]
    cli.run(["compare", *runs, "--pairs", str(tmp_path / "pairs"), "--out", str(tmp_path / "out")])
    rows = (tmp_path / "out" / "compare.md").read_text().splitlines()[2:]
    expected = [(name, numbers) for name in ("both", "one") for numbers in ("floats", "integers")]
    expected.append(("one, every second scan", "integers"))
    assert [tuple(row.strip("| ").split(" | ")[:2]) for row in rows[1:]] == expected
    assert all(float(value) > 0 for row in rows[1:] for value in row.strip("|").split("|")[4:])
    assert (tmp_path / "out" / "compare.svg").stat().st_size > 1000


@pytest.mark.parametrize("pairs", [6, 5])
def test_the_mask_of_every_second_scan_is_used_for_the_next_one(pairs):
    scans = torch.arange(1.0, pairs + 2)[:, None, None].expand(-1, 2, 2)
    masks = EverySecond(lambda given: 10 ** given)  # identifies the scan of a mask
    later, earlier = masks.masked(scans[1:], scans[:-1])
    owners = [int(torch.log10(masked[0, 0] / scan[0, 0]).round()) for masked, scan in zip(later, scans[1:])]
    assert owners == [1, 3, 3, 5, 5, 7][:pairs]
    assert [int(torch.log10(masked[0, 0] / scan[0, 0]).round()) for masked, scan in zip(earlier, scans)] == [1, 1, 3, 3, 5, 5][:pairs]
