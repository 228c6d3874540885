"""The weights of a published model, as the start of another training."""

from pathlib import Path

import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn

from .network import MaskNetwork


@torch.no_grad()
def restore(network: MaskNetwork, path: Path, example: Tensor) -> None:
    """Gives a network the weights of an ONNX file in floats, with the masks that the file computes.

    The export merged each batch norm into the convolution before it. Here the batch norm gets the mean and the deviation
    that the convolution has over `example` (batch, inputs, n, n), and the factors that undo them: evaluation gives the
    masks of the file, and training begins where statistics of a batch change little.

    Raises SystemExit if the file is quantised, or of a network of another shape.
    """
    layers = [layer for layer in network.modules() if isinstance(layer, (nn.Conv2d, nn.BatchNorm2d))]
    own, merged = [layer for layer in layers if isinstance(layer, nn.Conv2d)], convolutions(path)
    if [weight.shape for weight, _ in merged] != [layer.weight.shape for layer in own]:
        raise SystemExit(f"{path} is a network of another shape, or quantised")
    for layer, (weight, _) in zip(own, merged):
        layer.weight.copy_(weight)
    biases = [bias for _, bias in merged if bias is not None]
    biased = [layer for layer in layers if layer.bias is not None]
    for layer, bias in zip(biased, biases):
        layer.bias.copy_(bias)
    hooks = [layer.register_forward_pre_hook(measure) for layer in biased if isinstance(layer, nn.BatchNorm2d)]
    network.eval()(example)
    for hook in hooks:
        hook.remove()


def measure(norm: nn.BatchNorm2d, inputs: tuple[Tensor]) -> None:
    """Sets the statistics of a batch norm to those of its input, and its factors so that it adds `bias` and nothing else."""
    deviation, mean = torch.std_mean(inputs[0], (0, 2, 3))
    norm.running_mean.copy_(mean)
    norm.running_var.copy_(deviation.square())
    norm.weight.copy_((norm.running_var + norm.eps).sqrt())
    norm.bias.add_(mean)


def convolutions(path: Path) -> list[tuple[Tensor, Tensor | None]]:
    """Returns weights and biases of the convolutions of an ONNX file, in the order of computation."""
    graph = onnx.load(str(path)).graph
    values = {one.name: torch.from_numpy(numpy_helper.to_array(one).copy()) for one in graph.initializer}
    nodes = [node for node in graph.node if node.op_type == "Conv"]
    return [(values.get(node.input[1], torch.zeros(0)), values.get("".join(node.input[2:]))) for node in nodes]
