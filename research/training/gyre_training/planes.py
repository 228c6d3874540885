"""What networks share that are shown planes of cells: layers, training and export."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.utils.data import DataLoader, Dataset


def convolution(inputs: int, outputs: int, stride: int = 1, size: int = 3) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)
    )


def level(inputs: int, outputs: int) -> nn.Sequential:
    """Halves the resolution."""
    return nn.Sequential(convolution(inputs, outputs, 2), convolution(outputs, outputs), convolution(outputs, outputs))


def batches(draw: Callable[[np.random.Generator], tuple[np.ndarray, ...]], steps: int, size: int) -> DataLoader:
    """Returns the batches of a training: so many samples each, drawn by a process beside it."""

    class Batches(Dataset):
        def __len__(self) -> int:
            return steps

        def __getitem__(self, step: int) -> list[np.ndarray]:
            random = np.random.default_rng(step)
            return [np.stack(it) for it in zip(*(draw(random) for _ in range(size)))]

    # A process that is forked has what `draw` draws from; another one would have to be sent it.
    return DataLoader(Batches(), batch_size=None, num_workers=1, multiprocessing_context="fork")


def optimise(network: nn.Module, drawn: DataLoader, loss: Callable[..., torch.Tensor], rate: float = 2e-3) -> None:
    """Trains by a step for each batch, with a rate that rises and falls once. The first of a batch
    is what the network is shown; the loss compares what it says with the others.

    All is computed in floats of 32 bits: with bfloat16 a processor that lacks it is slower."""
    network.train()
    optimiser = torch.optim.AdamW(network.parameters(), weight_decay=1e-2)
    losses, steps = [], len(drawn)
    for step, (planes, *targets) in enumerate(drawn):
        done = step / steps
        for group in optimiser.param_groups:
            group["lr"] = rate * min(1, done / 0.03 + 0.05) * 0.5 * (1 + np.cos(np.pi * done)) + 1e-5
        value = loss(network(planes.contiguous(memory_format=torch.channels_last)), *targets)
        optimiser.zero_grad()
        value.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 5.0)
        optimiser.step()
        losses.append(value.item())
        if len(losses) == 500:
            print(f"step {step + 1} of {steps}: loss {np.mean(losses):.4f}", flush=True)
            losses = []


def export(network: nn.Module, planes: torch.Tensor, path: Path) -> None:
    """Writes a network as ONNX, for planes of this shape."""
    path.parent.mkdir(parents=True, exist_ok=True)
    torch.onnx.export(
        network.eval(), (planes,), path, input_names=["planes"], output_names=["values"], opset_version=17, dynamo=False
    )
