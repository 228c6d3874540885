"""Writes the tests' models: the sigmoid of one convolution each, whose weights the tests repeat by hand.

    python3 shared/method/masking/tests/models/make.py

needs the package onnx.
"""

import hashlib
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

HERE = Path(__file__).parent


def weights(channels):
    """Kernel [channels, channels, 3, 3]: no two values alike, none of them symmetric; all exact in binary."""
    count = channels * channels * 9
    kernel = (np.arange(count) * 5 % 13 - 6).astype(np.float32) / 64
    bias = np.arange(channels).astype(np.float32) / 4 + 0.125
    return kernel.reshape(channels, channels, 3, 3), bias


def model(channels, n, opset):
    shape = [1, channels, n, n]
    kernel, bias = weights(channels)
    graph = helper.make_graph(
        [
            helper.make_node("Mul", ["scans", "scale"], ["scaled"]),
            helper.make_node("Conv", ["scaled", "kernel", "bias"], ["logits"], pads=[1, 1, 1, 1]),
            helper.make_node("Sigmoid", ["logits"], ["masks"]),
        ],
        "mask",
        [helper.make_tensor_value_info("scans", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info("masks", TensorProto.FLOAT, shape)],
        [
            numpy_helper.from_array(np.float32(1 / 16), "scale"),
            numpy_helper.from_array(kernel, "kernel"),
            numpy_helper.from_array(bias, "bias"),
        ],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=8)


def write(name, channels, n, cell_m, opset=17):
    data = model(channels, n, opset).SerializeToString()
    (HERE / f"{name}.onnx").write_bytes(data)
    (HERE / f"{name}.toml").write_text(
        f"""[model]
file = "{name}.onnx"
sha256 = "{hashlib.sha256(data).hexdigest()}"
inputs = {channels}
opset = {opset}
parameters = {channels * channels * 9 + channels}

[raster]
n = {n}
cell_m = {cell_m}

[training]
command = "none: see make.py"
"""
    )


write("single-31", 1, 31, 0.8)
write("pair-31", 2, 31, 0.8)
write("single-127", 1, 127, 0.8)
write("pair-127", 2, 127, 0.8)
write("pair-255", 2, 255, 0.4)
write("opset-99", 1, 31, 0.8, opset=99)
