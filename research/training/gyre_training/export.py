"""Export of a trained network as an ONNX file, quantisation, and its masks by ONNX Runtime."""

import tempfile
from pathlib import Path

import numpy as np
import onnxruntime
import torch
from onnxruntime import quantization
from onnxruntime.quantization.shape_inference import quant_pre_process
from torch import Tensor

from .network import MaskNetwork
from .pairs import Scans

OPSET = 17


class OnnxMasks:
    """An ONNX file with the interface of `MaskNetwork`: the masks that Gyre computes."""

    def __init__(self, path: Path, threads: int = 1):
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.log_severity_level = 3
        self.session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        self.inputs = self.session.get_inputs()[0].shape[1]

    def __call__(self, scans: Tensor) -> Tensor:
        """Returns masks (batch, inputs, n, n) of scans of that shape, one at a time."""
        masks = [self.session.run(None, {"scans": one[None].numpy()})[0] for one in scans.cpu()]
        return torch.from_numpy(np.concatenate(masks)).to(scans.device)

    def masked(self, later: Tensor, earlier: Tensor) -> tuple[Tensor, Tensor]:
        """See `MaskNetwork.masked`."""
        scans = torch.stack([later, earlier], 1)
        flat = scans.flatten(0, 1)[:, None] if self.inputs == 1 else scans
        return tuple((scans * self(flat).view_as(scans)).unbind(1))


def export(network: MaskNetwork, n: int, path: Path) -> None:
    """Writes the network for rasters of n x n cells with a batch of 1, and checks that ONNX Runtime computes the same
    masks."""
    network = network.eval().cpu()
    example = 255 * torch.rand(1, network.config.inputs, n, n, generator=torch.Generator().manual_seed(1)) ** 4
    path.parent.mkdir(parents=True, exist_ok=True)
    torch.onnx.export(
        network, (example,), str(path), input_names=["scans"], output_names=["masks"], opset_version=OPSET, dynamo=False
    )
    with torch.no_grad():
        difference = float((OnnxMasks(path)(example) - network(example)).abs().max())
    if difference > 1e-4:
        raise RuntimeError(f"{path}: ONNX Runtime's masks differ from PyTorch's by up to {difference}")


def quantise(path: Path, scans: Scans, out: Path, examples: int = 64) -> None:
    """Writes the network quantised to 8-bit integers: weights per channel, activations per tensor, calibrated on training
    scans. Activations are unsigned and weights signed, which x86 multiplies fastest. Weights use 7 bits, because processors
    without VNNI add two products in 16 bits, which overflow at 2 x 255 x 127."""
    with tempfile.TemporaryDirectory() as folder:
        prepared = Path(folder) / "prepared.onnx"
        quant_pre_process(str(path), str(prepared))
        quantization.quantize_static(
            str(prepared),
            str(out),
            Calibration(scans, OnnxMasks(path).inputs, examples),
            quant_format=quantization.QuantFormat.QDQ,
            per_channel=True,
            reduce_range=True,
            activation_type=quantization.QuantType.QUInt8,
            weight_type=quantization.QuantType.QInt8,
        )


class Calibration(quantization.CalibrationDataReader):
    """Calibration scans, spread evenly over a file."""

    def __init__(self, scans: Scans, inputs: int, examples: int):
        self.left = iter(scans.examples(inputs, examples).numpy()[:, None])

    def get_next(self) -> dict | None:
        scans = next(self.left, None)
        return None if scans is None else {"scans": scans}
