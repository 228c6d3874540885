"""The network that finds changes between two drives: its input, its truth, and that it learns."""

import numpy as np
import pytest
import torch

from gyre_training import changes
from gyre_training.changes import CELL_M, PLANES, SIDE, Pair
from gyre_training.planes import export

SIZE = (160, 128)
CORNER = np.array([-40.0, 20.0])


def pair(cars) -> Pair:
    """Two drives that know all cells, one of which has returns in the outlines of its cars."""
    planes = np.zeros((2, PLANES, *SIZE), np.uint8)
    planes[:, 0] = 255
    at = (np.stack(np.meshgrid(*map(np.arange, SIZE), indexing="ij"), axis=-1) + 0.5 + CORNER) * CELL_M
    for is_gone, x, y, yaw, length, width, *_ in cars:
        along, across = np.moveaxis((at - (x, y)) @ [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]], -1, 0)
        is_own = (np.abs(along) < length / 2) & (np.abs(across) < width / 2)
        planes[0 if is_gone else 1, 1:, is_own] = 200
    return Pair(CORNER, planes, np.array(cars, float))


GONE = (1.0, 10.0, 40.0, 0.6, 4.5, 1.9, 1.0)
APPEARED = (0.0, 22.0, 52.0, -0.4, 4.5, 1.9, 1.0)
HIDDEN = (1.0, 5.0, 55.0, 0.0, 4.5, 1.9, 0.0)


def test_a_file_is_read_as_the_example_writes_it(tmp_path):
    planes = np.arange(2 * PLANES * 3 * 2) / 255
    values = [-7, 4, 3, 2, 1, *GONE, *planes]
    np.array(values, "<f4").tofile(tmp_path / "pair")
    read = changes.read(tmp_path / "pair")
    assert read.corner.tolist() == [-7, 4] and np.allclose(read.cars, [GONE])
    assert np.array_equal(read.planes, np.arange(2 * PLANES * 6).reshape(2, PLANES, 3, 2))


@pytest.fixture
def as_they_are(monkeypatch):
    """Leaves cars the returns that they have."""
    monkeypatch.setattr(changes, "KEPT", 1.0)
    monkeypatch.setattr(changes, "UNCHANGED", 0.0)


@pytest.mark.usefixtures("as_they_are")
def test_a_car_that_is_gone_is_where_the_first_drive_has_returns_and_the_second_one_has_none():
    both, random = pair([GONE, APPEARED]), np.random.default_rng(0)
    cars = 0
    for _ in range(40):
        planes, is_gone, counts = changes.sample(both, np.array([60, 60]), random)
        is_one, is_other = planes[2] > 0.3, planes[PLANES + 2] > 0.3
        marked = is_gone > 0
        # By half a cell and a placement that is wrong on purpose.
        assert np.mean(is_one[marked]) > 0.9 or not marked.any()
        assert not is_other[marked].any()
        assert counts[marked].all()
        assert not (is_one & ~is_other & ~marked & (counts > 0))[2:-2, 2:-2].sum() > 25
        cars += marked.sum() > 8
    assert cars > 20


@pytest.mark.usefixtures("as_they_are")
def test_a_car_that_is_not_in_sight_may_be_said_to_be_gone_or_not():
    planes, is_gone, counts = changes.sample(pair([HIDDEN]), np.array([50, 90]), np.random.default_rng(1))
    its = planes[2] > 0.3
    assert its.any() or planes[PLANES + 2].any()
    assert not is_gone.any() and not counts[its].any()


def test_cars_whose_returns_are_made_anew_have_them_on_their_body(monkeypatch):
    both, random = pair([GONE]), np.random.default_rng(3)
    for kept, unchanged in ((0.0, 0.0), (0.0, 1.0)):
        monkeypatch.setattr(changes, "KEPT", kept)
        monkeypatch.setattr(changes, "UNCHANGED", unchanged)
        for _ in range(20):
            planes, is_gone, _ = changes.sample(both, np.array([60, 60]), random)
            cells = np.argwhere(planes[2] + planes[PLANES + 2] > 0.1)
            spread = np.ptp(cells, axis=0) if len(cells) else np.zeros(2)
            assert np.hypot(*spread) * CELL_M < 8.0
            assert (planes[1:PLANES] <= 1.0).all()
            if unchanged:
                # It stands on both drives, whatever it looks like.
                assert not is_gone.any()
                assert (planes[2].max() > 0) == (planes[PLANES + 2].max() > 0)


def test_half_of_the_places_are_those_of_cars():
    cells = changes.places(pair([GONE]))
    at = np.round(np.array(GONE[1:3]) / CELL_M - CORNER)
    share = np.mean((cells == at).all(axis=1))
    assert 0.4 < share < 0.6


def test_the_network_learns_and_is_written(tmp_path):
    both, random = pair([GONE, APPEARED]), np.random.default_rng(2)
    drawn = [changes.sample(both, np.array([60, 60]), random) for _ in range(8)]
    planes, *truth = [torch.from_numpy(np.stack(it)) for it in zip(*drawn)]
    torch.manual_seed(0)
    before = changes.loss(changes.Network().eval()(planes), *truth).item()
    network = changes.train([both], steps=80, batch=4)
    assert changes.loss(network.eval()(planes), *truth).item() < 0.5 * before
    export(network, torch.zeros(1, 2 * PLANES, SIDE, SIDE), tmp_path / "network.onnx")
    assert (tmp_path / "network.onnx").stat().st_size > 500_000
