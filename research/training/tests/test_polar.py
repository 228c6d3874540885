import torch

from gyre_training.network import MaskNetwork, NetworkConfig
from gyre_training.polar import AZIMUTHS, MARGIN, to_polar, to_raster

N = 63


def test_a_raster_survives_resampling_to_polar_and_back():
    offset = torch.arange(N) - (N - 1) / 2
    # Two smooth peaks, one of them at the seam of azimuths.
    hill = lambda row, column: torch.exp(-((offset[:, None] - row) ** 2 + (offset - column) ** 2) / 50.0)
    raster = (hill(0.3, 15.0) + hill(-12.0, -8.0))[None, None]
    polar = to_polar(raster)
    assert polar.shape == (1, 1, AZIMUTHS + 2 * MARGIN, 45)
    assert torch.allclose(polar[..., : 2 * MARGIN, :], polar[..., AZIMUTHS:, :], atol=1e-5)
    assert (to_raster(polar, N) - raster).abs().max() < 0.02


def test_azimuth_zero_is_along_columns():
    raster = torch.zeros(1, 1, N, N)
    raster[..., N // 2, N // 2 + 20] = 1.0
    azimuth, range_ = divmod(int(to_polar(raster).flatten().argmax()), 45)
    assert azimuth in (MARGIN, MARGIN + AZIMUTHS) and range_ in (19, 20)


def test_masks_of_a_polar_network_rotate_with_the_scan():
    torch.manual_seed(1)
    network = MaskNetwork(NetworkConfig(inputs=1, widths=(4, 8), polar=True)).eval()
    scan = 255 * torch.rand(1, 1, N, N)
    with torch.no_grad():
        masks, of_turned = network(scan), network(scan.rot90(1, (2, 3)))
    # Up to rounding, also at the seam of azimuths, which a quarter turn moves.
    assert (of_turned - masks.rot90(1, (2, 3))).abs().max() < 1e-3
