"""Calls a function of a user's file: a stage sends the arguments through standard input, and reads the result."""

from __future__ import annotations

import ctypes
import importlib.util
import json
import os
import pathlib
import signal
import sys
import traceback
import types

# The function may print, and read what it likes: its standard output is the log.
requests, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
os.dup2(2, 1)
# Ctrl-C and SIGTERM are for the stage; with it ends this process, whatever it does.
for ignored in (signal.SIGINT, signal.SIGTERM):
    signal.signal(ignored, signal.SIG_IGN)
ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def answer(header: dict, data: bytes | memoryview = b"") -> None:
    answers.write(json.dumps(header).encode() + b"\n")
    answers.write(data)
    answers.flush()


def refuse(sentence: str) -> None:
    answer({"error": sentence})


def refuse_with_place(path: pathlib.Path, error: BaseException) -> None:
    """Prints the traceback from the user's file on, and answers with the deepest line of that file in it."""
    trace = error.__traceback__ and error.__traceback__.tb_next
    traceback.print_exception(type(error), error, trace)
    lines = [frame.lineno for frame in traceback.extract_tb(trace) if frame.filename == str(path)]
    words = str(error)
    if isinstance(error, SyntaxError) and error.filename == str(path):
        lines.append(error.lineno)
        words = error.msg
    place = f", line {lines[-1]}" if lines else ""
    refuse(f"{path}{place}: {type(error).__name__}: {' '.join(words.split())}")


def whole(result):
    """Returns what a function has returned, unless numpy would leave a part of it out."""
    for part in result if isinstance(result, (tuple, list)) else [result]:
        if np.iscomplexobj(part):
            raise ValueError("it returned complex numbers: return real ones, as of `.real` or `abs()`")
        if np.ma.is_masked(part):
            raise ValueError("it returned masked values: replace them, as with `.filled(0)`")
    return result


def mask(result, scan) -> tuple[dict, memoryview]:
    result = np.asarray(result)
    # A quarter of the bytes, where they are all 0 or 1.
    factors = np.ascontiguousarray(result, np.uint8 if result.dtype == bool else np.float32)
    shapes = {"power": scan.power.shape, "raster": scan.raster.shape}
    of = [name for name, shape in shapes.items() if factors.shape == shape]
    if not of:
        raise ValueError(f"it returned an array of shape {factors.shape}: expected that of scan.power, {shapes['power']}, "
                         f"or of scan.raster, {shapes['raster']}")
    if len(of) == 2:
        raise ValueError(f"scan.power and scan.raster are both {factors.shape}: choose another raster.n")
    if result.dtype != bool and not (factors.min() >= 0.0 and factors.max() <= 1.0):
        raise ValueError("it returned factors that are not all from 0 to 1")
    return {"of": of[0], "kind": factors.dtype.str[1:], "shape": factors.shape}, factors.data


def rotation(result, *_) -> tuple[dict, bytes]:
    angle_rad, sigma_rad = finite(result)
    if abs(angle_rad) > np.pi or sigma_rad < 0.0:
        raise ValueError(f"it returned {angle_rad} rad with a standard deviation of {sigma_rad}: expected at most half a turn, and 0 or more")
    return {"values": [angle_rad, sigma_rad**2]}, b""


def translation(result, *_) -> tuple[dict, bytes]:
    x_m, y_m, spread = result
    is_sigma = np.ndim(spread) == 0
    covariance = np.eye(2) * float(spread) ** 2 if is_sigma else np.asarray(spread, float).reshape(2, 2)
    values = finite([x_m, y_m, *covariance.ravel()])
    is_one = spread >= 0.0 if is_sigma else np.allclose(covariance, covariance.T) and np.linalg.eigvalsh(covariance).min() >= 0.0
    if not is_one:
        raise ValueError(f"it returned {spread}, which is neither a standard deviation nor a covariance")
    return {"values": values}, b""


def finite(values) -> list[float]:
    values = [float(value) for value in values]
    if not np.isfinite(values).all():
        raise ValueError(f"it returned numbers that are not finite: {values}")
    return values


# What a function returns, by its name, for the stage.
RETURNS = {"mask": mask, "rotation": rotation, "translation": translation}


def load(path: pathlib.Path, name: str):
    sys.path.insert(0, str(path.parent))
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    function = getattr(module, name, None)
    if not callable(function):
        raise AttributeError(f"there is no function `{name}`")
    return function


def argument(description):
    """Returns a number, or a scan with its arrays, which cannot be written to."""
    if not isinstance(description, dict):
        return description
    scan = types.SimpleNamespace(**description["values"])
    for name, kind, shape in description["arrays"]:
        data = requests.read(int(np.prod(shape)) * np.dtype(kind).itemsize)
        setattr(scan, name, np.frombuffer(data, kind).reshape(shape))
    return scan


def main(path: pathlib.Path, name: str) -> None:
    try:
        function = load(path, name)
    except BaseException as error:
        refuse_with_place(path, error)
        return
    answer({})
    while request := requests.readline():
        arguments = [argument(description) for description in json.loads(request)]
        try:
            header, data = RETURNS[name](whole(function(*arguments)), *arguments)
        except BaseException as error:
            refuse_with_place(path, error)
            return
        answer(header, data)


try:
    import numpy as np
except ImportError as missing:
    refuse(f"{sys.executable} cannot import numpy ({missing}): install it there, or name another Python with GYRE_PYTHON")
else:
    main(pathlib.Path(sys.argv[1]), sys.argv[2])
