"""A trained network as `models/NAME.onnx` with its card `models/NAME.toml`."""

import hashlib
import json
from pathlib import Path

import numpy as np
import torch

from .network import MaskNetwork

OPSET = 17


def export(network: MaskNetwork, n: int, path: Path) -> None:
    """Writes the network for rasters of n x n cells, one pair at a time, batch norms folded, and checks that ONNX Runtime
    finds the same masks."""
    network = network.eval().cpu()
    example = 255 * torch.rand(1, network.config.inputs, n, n, generator=torch.Generator().manual_seed(1)) ** 4
    path.parent.mkdir(parents=True, exist_ok=True)
    torch.onnx.export(network, (example,), str(path), input_names=["scans"], output_names=["masks"],
                      opset_version=OPSET, dynamo=False)
    difference = np.abs(run(path, example.numpy()) - network(example).detach().numpy()).max()
    if difference > 1e-4:
        raise RuntimeError(f"{path}: ONNX Runtime's masks differ from PyTorch's by up to {difference}")


def run(path: Path, scans: np.ndarray) -> np.ndarray:
    """The masks that ONNX Runtime finds, one pair (or scan) after the other: (batch, inputs, n, n)."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    return np.concatenate([session.run(None, {"scans": one[None]})[0] for one in scans])


def card(path: Path, network: MaskNetwork, settings: dict, provenance: dict) -> None:
    """Writes what a user of the model needs to know: what it looks at, how it was made, its checksum."""
    content = path.read_bytes()
    sections = {
        "model": {
            "file": path.name,
            "sha256": hashlib.sha256(content).hexdigest(),
            "bytes": len(content),
            "inputs": network.config.inputs,
            "opset": OPSET,
            "parameters": network.parameters_count(),
        },
        "raster": settings["raster"],
        "masking": {key: settings["masking"][key] for key in ("kind", "threshold", "compensate")},
        "network": network.config.to_dict(),
        **provenance,
    }
    path.with_suffix(".toml").write_text("\n".join(section(name, values) for name, values in sections.items()))


def section(name: str, values: dict) -> str:
    return f"[{name}]\n" + "".join(f"{key} = {toml(value)}\n" for key, value in values.items())


def toml(value) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(v)}" for key, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)
