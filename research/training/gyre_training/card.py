"""Model cards, `models/NAME.toml`: provenance for the user, and what Gyre checks before it runs the model."""

import hashlib
import json
from pathlib import Path


def write(path: Path, inputs: int, opset: int, parameters: int, settings: dict, provenance: dict) -> None:
    """Writes the card of the ONNX file at `path`. `settings` is the resolved configuration of the rasters."""
    content = path.read_bytes()
    model = {"file": path.name, "sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
    masking = settings["masking"]
    floor = 0 if masking["kind"] == "none" else masking["threshold"]
    sections = {
        "model": model | {"inputs": inputs, "opset": opset, "parameters": parameters},
        "raster": settings["raster"],
        "masking": {"floor": floor, "compensate": masking["compensate"], "undo_doppler": masking["undo_doppler"]},
        **provenance,
    }
    path.with_suffix(".toml").write_text("\n".join(section(name, values) for name, values in sections.items()))


def section(name: str, values: dict) -> str:
    return f"[{name}]\n" + "".join(f"{key} = {toml(value)}\n" for key, value in values.items())


def toml(value) -> str:
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)
