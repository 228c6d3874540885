import math

import pytest
import torch

from gyre_training.exhaustive import ExhaustiveMatch
from gyre_training.peaks import SoftArgmax
from gyre_training.search import RotationSearch, ScanMatch, SearchConfig, TranslationSearch
from scenes import scene

GYRE = SearchConfig("eq7", "radial_hann", 0.05, 0.45, 576, 51, overlap="energy", peak="gaussian")
CONFIGS = {"line 14": SearchConfig(form="line14"), "Eq. 7": SearchConfig(), "Gyre": GYRE}
MOTIONS = [(0.0, 0.0, 0.0), (3.1, 0.0, 0.0), (2.0, -1.4, 0.05), (-4.3, 0.7, -0.12), (0.3, 5.2, 0.2)]


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS)
@pytest.mark.parametrize("motion", MOTIONS)
def test_known_motions_are_found_by_highest_peak_and_soft_argmax(config, motion):
    match = ScanMatch(127, 0.8, config)
    later, earlier = scene(127, 0.8, motion)
    # Sixty scatterers under a taper that does not rotate with them determine the angle to a fifth of a degree.
    for found, tolerance_m, tolerance_deg in [(match.hard(later, earlier), 0.15, 0.3), (match(later, earlier), 0.5, 1.0)]:
        error = (found[0].double() - torch.tensor(motion).double()).abs()
        assert error[:2].max() < tolerance_m, found
        assert math.degrees(error[2]) < tolerance_deg, found


@pytest.mark.parametrize("motion", [(2.0, -1.4, 0.05), (-4.3, 0.7, -0.12)])
def test_the_exhaustive_search_finds_known_motions(motion):
    match = ExhaustiveMatch(63, 0.8, SearchConfig(reach_m=8.0))
    later, earlier = scene(63, 0.8, motion)
    for found, tolerance in [(match.hard(later, earlier), 0.15), (match(later, earlier), 0.6)]:
        assert (found[0, :2].double() - torch.tensor(motion[:2]).double()).abs().max() < tolerance, found
        assert abs(math.degrees(found[0, 2] - motion[2])) < 1.0, found


def test_a_motion_forward_moves_points_down():
    # After 4 m forward a point ahead is 4 m nearer: 5 cells down.
    match = ScanMatch(63, 0.8, SearchConfig(reach_m=8.0))
    later, earlier = torch.zeros(1, 63, 63), torch.zeros(1, 63, 63)
    for row, col in [(15, 20), (22, 40), (12, 31)]:
        earlier[0, row, col] = later[0, row + 5, col] = 1.0
    x, y, yaw = match.hard(later, earlier)[0]
    assert abs(x - 4.0) < 0.05 and abs(y) < 0.05 and abs(math.degrees(yaw)) < 0.3


@pytest.mark.parametrize("form", ["line14", "eq7"])
def test_rotation_scores_equal_their_direct_sums(form):
    search = RotationSearch(32, SearchConfig(form=form, angles=45, radii=9))
    later, earlier = scene(32, 1.0, (0.0, 0.0, 0.1))
    polar = [torch.fft.irfft(search.spectra(raster), n=45, dim=2)[0] for raster in (later, earlier)]
    scores = search.correlation(later, earlier)[0]
    for score, shift in zip(scores, search.shifts.tolist(), strict=True):
        direct = (polar[1].roll(-shift, 1) * polar[0]).sum()
        assert torch.isclose(score, direct, rtol=1e-3, atol=1e-3 * scores.abs().max())


@pytest.mark.parametrize("overlap", ["none", "energy"])
def test_translation_scores_equal_their_direct_sums(overlap):
    search = TranslationSearch(20, 1.0, SearchConfig(reach_m=4.0, overlap=overlap))
    generator = torch.Generator().manual_seed(5)
    f, g = (torch.rand(1, 20, 20, generator=generator) for _ in range(2))
    scores = search.correlation(f, g)[0]
    for i, down in enumerate(search.shifts.tolist()):
        for j, right in enumerate(search.shifts.tolist()):
            a = f[0, max(0, -down) : 20 - max(0, down), max(0, -right) : 20 - max(0, right)]
            b = g[0, max(0, down) : 20 + min(0, down), max(0, right) : 20 + min(0, right)]
            e = (a.square().sum() * b.square().sum()) if overlap == "energy" else f.square().sum() * g.square().sum()
            assert torch.isclose(scores[i, j], (a * b).sum() / e.sqrt(), atol=1e-5)


@pytest.mark.parametrize("form", ["line14", "eq7"])
@pytest.mark.parametrize("overlap", ["none", "energy"])
def test_gradients_equal_finite_differences(form, overlap):
    config = SearchConfig(form=form, angles=72, radii=12, reach_m=6.0, overlap=overlap, soft=SoftArgmax(20.0))
    match = ScanMatch(31, 1.0, config).double()
    later, earlier = scene(31, 1.0, (1.3, -0.6, 0.07), dtype=torch.float64)
    masks = torch.rand(2, 31, 31, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    masks.requires_grad_()

    def pose(masks):
        return (match(later * masks[:1], earlier * masks[1:]) * torch.tensor([1.0, 1.0, 30.0])).sum()

    (gradient,) = torch.autograd.grad(pose(masks), masks)
    direction = torch.randn(masks.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    for along in (direction, gradient / gradient.norm()):
        step = 1e-5
        with torch.no_grad():
            difference = (pose(masks + step * along) - pose(masks - step * along)) / (2 * step)
        assert torch.isclose((gradient * along).sum(), difference, rtol=2e-3, atol=1e-8)


def test_the_soft_argmax_does_not_depend_on_the_scale_of_scores():
    scores = torch.randn(3, 40, generator=torch.Generator().manual_seed(1))
    weights = SoftArgmax(9.0).weights(scores)
    assert torch.allclose(weights, SoftArgmax(9.0).weights(1e-6 * scores + 4e-6), atol=1e-4)
    assert torch.allclose(weights.sum(1), torch.ones(3))
