"""Symmetric networks of two scans: exchanging the scans exchanges the masks.

So the error that the masks cause in a motion changes its sign with the order of the scans, and is zero on average while the
vehicle stands. Without this symmetry a network learns a yaw bias of about 0.01 degrees a motion, and the heading of a
standing vehicle drifts."""

from collections.abc import Sequence

import torch
from torch import Tensor, nn


@torch.no_grad()
def symmetrise(layers: nn.Module, parts: Sequence[int]) -> None:
    """Projects the weights of consecutive layers on the nearest ones that give exchanged features for exchanged features.

    The first half of all features belongs to the later scan, the second half to the earlier one. `parts` are the numbers of
    features of the tensors that are concatenated at the input, each with two halves."""
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
    """Returns the index of each feature after the scans are exchanged."""
    return torch.cat([torch.arange(size).roll(size // 2) + sum(parts[:k]) for k, size in enumerate(parts)])


def average(values: Tensor, others: Tensor) -> None:
    values.copy_((values + others) / 2)
