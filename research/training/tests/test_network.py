import copy

import pytest
import torch

from gyre_training.network import MaskNetwork, NetworkConfig


def test_mixed_precision_keeps_masks_gradients_and_weights_up_to_rounding():
    torch.manual_seed(1)
    exact = MaskNetwork(NetworkConfig(widths=(4, 8, 16))).train()
    mixed = copy.deepcopy(exact)
    mixed.mixed_precision = True
    scans = 255 * torch.rand(3, 2, 32, 32)
    for network in (exact, mixed):
        (network(scans) * scans).square().mean().backward()
    a, b = (torch.cat([weights.grad.flatten() for weights in network.parameters()]) for network in (exact, mixed))
    assert b.dtype == torch.float32 and torch.cosine_similarity(a, b, dim=0) > 0.95
    assert 0 < (exact.logits(scans) - mixed.logits(scans)).abs().max() < 0.1
    mixed.load_state_dict(exact.state_dict())
    assert torch.equal(exact.eval()(scans), mixed.eval()(scans))  # inference is not mixed


@pytest.mark.parametrize("mixed_precision", [False, True])
def test_checkpointing_changes_neither_gradients_nor_running_statistics(mixed_precision):
    torch.manual_seed(1)
    # 31 cells: odd sizes at every level.
    kept = MaskNetwork(NetworkConfig(widths=(4, 8, 16))).train()
    kept.mixed_precision = mixed_precision
    again = copy.deepcopy(kept)
    again.checkpoint = True
    scans = 255 * torch.rand(3, 2, 31, 31)
    for network in (kept, again):
        for _ in range(2):
            (network(scans) * scans).square().mean().backward()
    for (name, a), b in zip(kept.named_parameters(), again.parameters(), strict=True):
        assert torch.equal(a.grad, b.grad), name
    for (name, a), b in zip(kept.named_buffers(), again.buffers(), strict=True):
        assert torch.equal(a, b), name


def test_checkpointing_stores_less_for_the_backward_pass():
    def kept_bytes(checkpoint: bool) -> int:
        network = MaskNetwork(NetworkConfig(widths=(4, 8, 16))).train()
        network.checkpoint, kept = checkpoint, {}

        def pack(tensor):
            kept[tensor.untyped_storage().data_ptr()] = tensor.untyped_storage().nbytes()
            return tensor

        # The masks keep the saved tensors alive, so that no two share an address.
        with torch.autograd.graph.saved_tensors_hooks(pack, lambda tensor: tensor):
            masks = network(torch.rand(2, 2, 64, 64))
        return sum(kept.values()) if masks.requires_grad else 0

    assert kept_bytes(True) < 0.35 * kept_bytes(False)


@pytest.mark.parametrize("changes", [{}, {"separable": True, "widths": (8, 16, 32)}, {"fold": 2}, {"shrink": 2}])
def test_exchanging_the_scans_exchanges_the_masks(changes):
    torch.manual_seed(1)
    network = MaskNetwork(NetworkConfig(**{"widths": (4, 8, 16)} | changes))
    for tensor in network.state_dict().values():
        if tensor.is_floating_point():
            tensor.add_(0.2 * (torch.rand_like(tensor) - 0.5))
    scans = torch.tensor([255.0, 25.0])[:, None, None] * torch.rand(3, 2, 31, 31)
    with torch.no_grad():
        for _ in range(20):  # running statistics of batch norm
            network(scans)
        free = network.eval().logits(scans)
        assert not torch.allclose(network.logits(scans.flip(1)), free.flip(1), atol=1e-3)
        network.symmetrise()
        tied = network.logits(scans)
        assert torch.allclose(network.logits(scans.flip(1)), tied.flip(1), atol=1e-5)
        network.symmetrise()
        assert torch.equal(network.logits(scans), tied)
    assert not torch.allclose(tied[:, 0], tied[:, 1], atol=1e-4)


def test_odd_widths_of_a_two_scan_network_are_refused():
    with pytest.raises(ValueError, match="must be even"):
        NetworkConfig(widths=(4, 7))
    NetworkConfig(inputs=1, widths=(4, 7))
