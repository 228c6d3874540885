"""From a finished training to a model that Gyre runs."""

import csv
from pathlib import Path

import torch

from . import card
from .export import OPSET, export, quantise
from .pairs import Scans
from .recipe import Recipe
from .train import load, trained


def publish(recipe: Recipe, folder: Path, pairs: Path, models: Path) -> Path:
    """Writes the best epoch of a run as `NAME.onnx` and its card."""
    network, scans = trained(folder / "best.pt"), Scans(pairs / "train.npy")
    path = models / f"{recipe.name}.onnx"
    export(network, scans.n, path)
    if recipe.integers:
        quantise(path, scans, path)
    numbers = "8-bit integers" if recipe.integers else "32-bit floats"
    about = {"network": network.config.to_dict() | {"numbers": numbers}, "training": provenance(recipe, folder, scans)}
    card.write(path, network.config.inputs, OPSET, network.parameters_count(), scans.settings, about)
    print(f"wrote {path} ({path.stat().st_size / 1e6:.1f} MB)", flush=True)
    return path


def provenance(recipe: Recipe, folder: Path, scans: Scans) -> dict:
    """How the model came about: what its card says beside what it looks at."""
    state = load(folder / "best.pt")
    with (folder / "log.csv").open() as file:
        rows = list(csv.DictReader(file))
    best = min(rows, key=lambda row: float(row["translation_percent"]))
    training = state["meaning"]["training"]
    return {
        "command": f"python -m gyre_training reproduce training/recipes/{recipe.name}.toml",
        "data": "simulated only: training/worlds/train",
        "initial": recipe.initial or "",
        "scans": len(scans.records),
        "seed": training["seed"],
        "batch": training["batch"],
        "epochs": training["epochs"],
        "epoch_pairs": training["epoch_pairs"],
        "best_epoch": int(best["epoch"]),
        "validation_translation_percent": float(best["translation_percent"]),
        "validation_rotation_deg_per_100m": float(best["rotation_deg_per_100m"]),
        "minutes": round(float(rows[-1]["seconds"]) / 60, 1),
        "machine": state["machine"],
        "torch": torch.__version__,
    }
