import math

import numpy as np
import pytest
import torch

from gyre_training.drift import chain
from gyre_training.exhaustive import ExhaustiveMatch
from gyre_training.pairs import Batch, Sampling, augmented, between, inverse, mirror
from gyre_training.search import SearchConfig
from scenes import scene, write


def poses(count: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-50, 50, (count, 2)), rng.uniform(-math.pi, math.pi, count)])


def test_chained_motions_give_the_poses():
    true = poses(12)
    found = chain(between(true[:-1], true[1:]))
    assert np.allclose(between(np.repeat(true[:1], 12, 0), true), between(np.zeros((12, 3)), found))


def test_the_inverse_is_the_motion_back():
    a, b = poses(20), poses(20, seed=2)
    back = inverse(torch.from_numpy(between(a, b))).numpy()
    assert np.allclose(back, between(b, a))


def test_yaw_differences_wrap():
    (motion,) = between(np.array([[0.0, 0.0, 3.1]]), np.array([[0.0, 0.0, -3.1]]))
    assert motion[2] == pytest.approx(2 * math.pi - 6.2)


def test_mirrored_rasters_are_flipped_left_to_right():
    rasters = torch.arange(18.0).view(2, 3, 3)
    mirrored = mirror(rasters, torch.tensor([False, True]))
    assert torch.equal(mirrored[0], rasters[0])
    assert mirrored[1].tolist() == [[11, 10, 9], [14, 13, 12], [17, 16, 15]]


def test_the_search_finds_the_motion_of_an_augmented_pair():
    motion, copies = (2.0, -1.4, 0.05), 12
    later, earlier = (raster.expand(copies, -1, -1) for raster in scene(63, 0.8, motion))
    batch = augmented(Batch(later, earlier, torch.tensor([motion]).expand(copies, -1)), np.random.default_rng(2))
    # All four combinations of mirrored and reversed.
    signs = {(x > 0, yaw > 0) for x, _, yaw in batch.motion.tolist()}
    assert len(signs) == 4
    found = ExhaustiveMatch(63, 0.8, SearchConfig(reach_m=8.0)).hard(batch.later, batch.earlier)
    error = (found - batch.motion).abs()
    assert error[:, :2].max() < 0.15 and math.degrees(error[:, 2].max()) < 1.0, found


def test_augmentation_copies_and_is_deterministic():
    later, earlier = scene(31, 1.0, (1.0, 0.5, 0.1))
    batch = Batch(later, earlier, torch.tensor([[1.0, 0.5, 0.1]]))
    before = later.clone()
    once, again = (augmented(batch, np.random.default_rng(3)) for _ in range(2))
    assert torch.equal(batch.later, before) and not torch.equal(once.later, before)
    assert torch.equal(once.later, again.later) and torch.equal(once.motion, again.motion)


def test_pairs_are_within_sequence_and_reach_and_few_are_standing(tmp_path):
    # 100 standing scans, then 100 of 5 m each; a new sequence in the middle of the latter.
    x = np.concatenate([np.zeros(100), 5.0 * np.arange(1, 101)])
    pose = np.column_stack([x, np.zeros(200), np.zeros(200)])
    scans = write(tmp_path / "pairs.npy", pose, sequence=[0] * 150 + [1] * 50)
    pairs = Sampling(steps=3, standing_share=0.1).pairs(scans, seed=1)
    shift = scans.motions(pairs)[:, 0]
    assert (scans.sequence[pairs[:, 0]] == scans.sequence[pairs[:, 1]]).all()
    assert shift.max() == 10.0  # three steps are 15 m, out of reach
    assert (shift == 5.0).sum() == 50 + 49 + 2  # two wider pairs start at standing scans
    assert 10 < (shift == 0.0).sum() < 60  # of 294
    assert np.array_equal(pairs, Sampling(steps=3).pairs(scans, seed=1))
    batch = scans.batch(pairs[:3])
    assert torch.equal(batch.motion, torch.from_numpy(scans.motions(pairs[:3])).float())
