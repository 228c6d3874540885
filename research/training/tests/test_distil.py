from pathlib import Path

import torch

from gyre_training.distil import Distiller
from gyre_training.network import NetworkConfig
from gyre_training.search import SearchConfig
from gyre_training.train import Trainer, TrainingConfig, load, trained
from scenes import drive

SEARCH = SearchConfig(angles=60, radii=10, reach_m=8.0)


def test_a_network_learns_the_masks_of_its_teacher(tmp_path: Path):
    scans = drive(tmp_path / "train.npy", 20), drive(tmp_path / "validation.npy", 19, seed=2)
    teacher = Trainer(tmp_path / "teacher", *scans, NetworkConfig(widths=(4, 8)), SEARCH, TrainingConfig())
    with torch.no_grad():
        for _ in range(40):  # running statistics of batch norm
            teacher.network(scans[0].rasters(scans[0].pairs(1)))
        teacher.network.masks.weight.mul_(10)  # masks far from one half
    teacher._save("best.pt")
    best = tmp_path / "teacher" / "best.pt"
    student = NetworkConfig(inputs=1, widths=(8, 16))
    config = TrainingConfig(batch=4, epochs=4, epoch_pairs=160, learning_rate=1e-2)
    learning = Distiller(best, tmp_path / "student", *scans, student, SEARCH, config)
    before = masks_apart(learning.network.eval(), trained(best), scans[1])
    learning.run()
    assert masks_apart(learning.network.eval(), trained(best), scans[1]) < 0.9 * before  # it cannot see the other scan
    assert set(load(tmp_path / "student" / "best.pt")["network"]) == set(learning.network.state_dict())


@torch.no_grad()
def masks_apart(one, other, scans) -> float:
    """Returns the power-weighted mean difference of the masks of two networks."""
    batch = scans.batch(scans.pairs(1))
    masked = [torch.stack(network.masked(batch.later, batch.earlier)) for network in (one, other)]
    return float((masked[0] - masked[1]).abs().sum() / (batch.later + batch.earlier).sum())
