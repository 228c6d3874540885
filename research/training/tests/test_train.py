import csv
import itertools
from pathlib import Path

import pytest
import torch

from gyre_training import train
from gyre_training.drift import Drift
from gyre_training.network import NetworkConfig
from gyre_training.search import SearchConfig
from gyre_training.train import Trainer, TrainingConfig, load, pose_error, trained
from scenes import drive

NETWORK = NetworkConfig(widths=(4, 8))
SEARCH = SearchConfig(angles=60, radii=10, reach_m=8.0)
CONFIG = TrainingConfig(batch=2, epochs=2, epoch_pairs=8)


class Interrupted(Exception):
    """Simulates a power failure."""


@pytest.fixture
def scans(tmp_path):
    return drive(tmp_path / "train.npy", 20), drive(tmp_path / "validation.npy", 19, seed=2)


def trainer(folder: Path, scans, **changes) -> Trainer:
    return Trainer(folder, *scans, NETWORK, SEARCH, TrainingConfig(**vars(CONFIG) | changes))


def interrupt(trainer: Trainer, monkeypatch, after: int) -> None:
    """Trains, and raises in the step after `after` more."""
    learn, done = trainer._learn, itertools.count()

    def until(*arguments):
        if next(done) == after:
            raise Interrupted
        return learn(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(trainer, "_learn", until)
        with pytest.raises(Interrupted):
            trainer.run()


def rows(folder: Path) -> list[dict]:
    with (folder / "log.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_an_interrupted_training_ends_with_the_same_weights(scans, tmp_path, monkeypatch):
    whole = trainer(tmp_path / "whole", scans)
    whole.run()
    # The clock advances a minute at each call: every step is saved.
    clock = itertools.count(0.0, 61.0)
    monkeypatch.setattr(train.time, "time", lambda: next(clock))
    interrupt(trainer(tmp_path / "cut", scans), monkeypatch, after=3)  # within the first epoch
    interrupt(trainer(tmp_path / "cut", scans), monkeypatch, after=3)  # within the second
    again = trainer(tmp_path / "cut", scans)
    assert again.step == 6
    again.run()
    assert again.step == whole.step == 8
    for name in ("last.pt", "best.pt"):
        a, b = load(tmp_path / "whole" / name), load(tmp_path / "cut" / name)
        assert a["step"] == b["step"] and a["best"] == b["best"]
        for key, weights in a["network"].items():
            assert torch.equal(weights, b["network"][key]), (name, key)
    for a, b in zip(rows(tmp_path / "whole"), rows(tmp_path / "cut"), strict=True):
        # The loss of an interrupted epoch is that of its last part.
        assert {**a, "seconds": 0, "loss": 0} == {**b, "seconds": 0, "loss": 0}


def test_steps_since_the_last_save_are_repeated(scans, tmp_path, monkeypatch):
    trainer(tmp_path / "whole", scans).run()
    interrupt(trainer(tmp_path / "cut", scans), monkeypatch, after=6)  # saved only at the end of the first epoch
    again = trainer(tmp_path / "cut", scans)
    assert again.step == 4
    again.run()
    a, b = (load(tmp_path / name / "last.pt")["network"] for name in ("whole", "cut"))
    assert all(torch.equal(a[key], b[key]) for key in a)


def test_an_epoch_interrupted_in_its_validation_is_validated_again(scans, tmp_path, monkeypatch):
    trainer(tmp_path / "whole", scans).run()
    cut, clock = trainer(tmp_path / "cut", scans), itertools.count(0.0, 61.0)
    with monkeypatch.context() as patch:
        patch.setattr(train.time, "time", lambda: next(clock))
        patch.setattr(cut, "validate", lambda: (_ for _ in ()).throw(Interrupted))
        with pytest.raises(Interrupted):
            cut.run()
    trainer(tmp_path / "cut", scans).run()
    # Time and loss of an interrupted epoch are those of its last part.
    both = [[{**row, "seconds": 0, "loss": 0} for row in rows(tmp_path / name)] for name in ("whole", "cut")]
    assert both[0] == both[1] and len(both[0]) == 2


def test_a_folder_of_another_training_is_refused(scans, tmp_path):
    trainer(tmp_path / "other", scans, seed=3)._save("best.pt")
    trainer(tmp_path / "run", scans)._save("last.pt")
    trainer(tmp_path / "run", scans)
    initial = {"initial": tmp_path / "other" / "best.pt"}
    for scans, changes, options in [(scans, {"seed": 2}, {}), (scans, {}, initial), (scans[::-1], {}, {})]:
        with pytest.raises(SystemExit, match="holds another training"):
            Trainer(tmp_path / "run", *scans, NETWORK, SEARCH, TrainingConfig(**vars(CONFIG) | changes), **options)


def test_a_run_without_newer_keys_is_resumed(scans, tmp_path):
    run = trainer(tmp_path / "run", scans)
    del run.meaning["training"]["clip"], run.meaning["network"]["polar"], run.meaning["training"]["sampling"]["reach_m"]
    run._save("last.pt")
    trainer(tmp_path / "run", scans)
    with pytest.raises(SystemExit, match="holds another training"):
        trainer(tmp_path / "run", scans, clip=2.0)


def test_training_reduces_the_loss(scans, tmp_path):
    training = trainer(tmp_path / "run", scans, epochs=30, learning_rate=1e-2, augment=False)
    training.run()
    losses = [float(row["loss"]) for row in rows(tmp_path / "run")]
    assert sum(losses[-5:]) < 0.7 * sum(losses[:5]), losses
    masks = trained(tmp_path / "run" / "best.pt")(scans[0].rasters([0, 1])[None])
    assert masks.shape == (1, 2, 32, 32) and 0 <= masks.min() and masks.max() <= 1


def test_the_best_epoch_is_chosen_after_the_learning_rate_has_decayed(scans, tmp_path, monkeypatch):
    training = trainer(tmp_path / "run", scans, epochs=10, epoch_pairs=2)
    drifts = iter([0.1, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 0.2, 1.0, 2.0])
    monkeypatch.setattr(training, "validate", lambda: Drift(next(drifts), 1.0, 1.0, 1.0))
    training.run()
    assert load(tmp_path / "run" / "best.pt")["step"] == 9


def test_the_angle_weight_scales_the_angle_error():
    found, true = torch.tensor([[1.0, -2.0, 0.1], [0.0, 0.0, 0.0]]), torch.zeros(2, 3)
    assert torch.allclose(pose_error(found, true, 30.0), torch.tensor([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]]))
