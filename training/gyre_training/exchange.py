"""Networks that look at two scans, and treat both alike: who exchanges the scans exchanges the masks.

So what the masks do to a motion changes its sign with the order of the scans, and is nothing on average while the vehicle
stands. A network that is free to tell the later scan from the earlier one learns to turn each motion by a hundredth of a degree or
so, always the same way, and a vehicle that waits turns on and on."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn


@torch.no_grad()
def symmetrise(layers: nn.Module, parts: Sequence[int]) -> None:
    """Makes the layers, in their order, give exchanged features for exchanged features, changing weights as little as can be.

    The first half of all features is the later scan's, the second half the earlier one's; `parts` says how many features
    each of those that are joined at the layers' input has, each with two halves of its own."""
    swapped = exchanged(parts)
    for layer in layers.modules():
        if isinstance(layer, nn.Conv2d):
            inputs = swapped if layer.groups == 1 else slice(None)
            swapped = exchanged([layer.out_channels]) if layer.groups == 1 else swapped
            average(layer.weight, layer.weight[swapped][:, inputs])
            if layer.bias is not None:
                average(layer.bias, layer.bias[swapped])
        elif isinstance(layer, nn.BatchNorm2d):
            for values in (layer.weight, layer.bias, layer.running_mean, layer.running_var):
                average(values, values[swapped])


def exchanged(parts: Sequence[int]) -> Tensor:
    """Where each feature goes when the scans are exchanged."""
    return torch.cat([torch.arange(size).roll(size // 2) + sum(parts[:k]) for k, size in enumerate(parts)])


def average(values: Tensor, others: Tensor) -> None:
    values.copy_((values + others) / 2)
