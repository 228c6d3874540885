"""What networks share that are shown planes of cells: layers, training and export."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from torch import nn


def convolution(inputs: int, outputs: int, stride: int = 1, size: int = 3) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, size, stride, size // 2, bias=False), nn.BatchNorm2d(outputs), nn.ReLU(inplace=True)
    )


def level(inputs: int, outputs: int) -> nn.Sequential:
    """Halves the resolution."""
    return nn.Sequential(convolution(inputs, outputs, 2), convolution(outputs, outputs), convolution(outputs, outputs))


def computed(network: nn.Module, planes: torch.Tensor) -> torch.Tensor:
    """Computes a network in half precision."""
    with torch.autocast("cpu", dtype=torch.bfloat16):
        return network(planes.contiguous(memory_format=torch.channels_last)).float()


def optimise(network: nn.Module, steps: int, next_loss: Callable[[], torch.Tensor], rate: float = 2e-3) -> None:
    """Trains for some steps, with a rate that rises and falls once. `next_loss` returns the loss of
    the next batch."""
    network.train()
    optimiser = torch.optim.AdamW(network.parameters(), weight_decay=1e-2)
    losses = []
    for step in range(steps):
        done = step / steps
        for group in optimiser.param_groups:
            group["lr"] = rate * min(1, done / 0.03 + 0.05) * 0.5 * (1 + np.cos(np.pi * done)) + 1e-5
        value = next_loss()
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
