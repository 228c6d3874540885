import hashlib
import tomllib

import pytest
import torch

from gyre_training import card
from gyre_training.export import OPSET, OnnxMasks, export, quantise
from gyre_training.network import MaskNetwork, NetworkConfig
from gyre_training.pairs import Scans
from gyre_training.published import restore
from scenes import drive

NETWORKS = {
    "both scans": NetworkConfig(inputs=2, widths=(4, 8)),
    "half the resolution": NetworkConfig(inputs=2, widths=(4, 8), shrink=2),
    "one scan, folded": NetworkConfig(inputs=1, widths=(8, 16), fold=4),
    "separable": NetworkConfig(inputs=1, widths=(8, 16), separable=True),
    "polar, folded": NetworkConfig(inputs=1, widths=(8, 16), fold=4, polar=True),
}


@pytest.fixture(scope="module")
def scans(tmp_path_factory) -> Scans:
    return drive(tmp_path_factory.mktemp("scans") / "train.npy", scans=8)


def scans_of(scans: Scans, inputs: int) -> torch.Tensor:
    pairs = scans.pairs(1)[:3]
    return scans.rasters(pairs[:, 1])[:, None] if inputs == 1 else torch.stack([scans.rasters(p[::-1].copy()) for p in pairs])


@pytest.mark.parametrize("config", NETWORKS.values(), ids=NETWORKS)
def test_onnx_runtime_computes_the_same_masks(config, scans, tmp_path):
    torch.manual_seed(1)
    network, path = MaskNetwork(config).eval(), tmp_path / "network.onnx"
    export(network, scans.n, path)
    given = scans_of(scans, config.inputs)
    with torch.no_grad():
        expected = network(given)
    found = OnnxMasks(path)(given)
    assert found.shape == given.shape and 0 <= found.min() and found.max() <= 1
    assert (found - expected).abs().max() < 1e-4


@pytest.mark.parametrize("config", [NETWORKS["both scans"], NETWORKS["one scan, folded"]])
def test_quantisation_changes_masks_a_little(config, scans, tmp_path):
    torch.manual_seed(1)
    floats, integers = tmp_path / "floats.onnx", tmp_path / "integers.onnx"
    export(MaskNetwork(config).eval(), scans.n, floats)
    quantise(floats, scans, integers, examples=4)
    given = scans_of(scans, config.inputs)
    difference = (OnnxMasks(floats)(given) - OnnxMasks(integers)(given)).abs()
    assert 0 < difference.max() and difference.mean() < 0.02


def test_a_card_identifies_its_file(tmp_path):
    path = tmp_path / "network.onnx"
    path.write_bytes(b"a network")
    settings = {"raster": {"n": 31, "cell_m": 0.8}, "masking": {"kind": "none", "threshold": 60, "compensate": False, "undo_doppler": True}}
    card.write(path, 2, OPSET, 17, settings, {"training": {"data": 'a "world"', "widths": [4, 8]}})
    read = tomllib.loads(path.with_suffix(".toml").read_text())
    assert read["model"]["sha256"] == hashlib.sha256(b"a network").hexdigest()
    assert (read["model"]["file"], read["model"]["inputs"], read["raster"]["n"]) == ("network.onnx", 2, 31)
    assert read["masking"] == {"floor": 0, "compensate": False, "undo_doppler": True}
    assert read["training"] == {"data": 'a "world"', "widths": [4, 8]}


@pytest.mark.parametrize("config", NETWORKS.values(), ids=NETWORKS)
def test_a_published_model_initialises_a_network(config, scans, tmp_path):
    torch.manual_seed(1)
    published, path = MaskNetwork(config), tmp_path / "network.onnx"
    given = scans_of(scans, config.inputs)
    published.train()(given)  # statistics that are not the initial ones
    export(published, scans.n, path)
    network = MaskNetwork(config)
    restore(network, path, given)
    with torch.no_grad():
        expected = published.eval()(given)
        assert (network.eval()(given) - expected).abs().max() < 1e-4
        assert (network.train()(given) - expected).abs().mean() < 1e-3


def test_a_model_of_another_shape_initialises_nothing(scans, tmp_path):
    path = tmp_path / "network.onnx"
    export(MaskNetwork(NETWORKS["both scans"]), scans.n, path)
    with pytest.raises(SystemExit, match="another shape"):
        restore(MaskNetwork(NETWORKS["one scan, folded"]), path, scans_of(scans, 1))
