"""Publishes a finished run as a model for Gyre."""

import csv
from pathlib import Path

from . import card
from .export import OPSET, export, quantise
from .pairs import Scans
from .recipe import Recipe
from .train import load, trained
from .worlds import followed, worlds_of


def publish(recipe: Recipe, folder: Path, pairs: Path, models: Path) -> Path:
    """Writes the best epoch of a run as `NAME.onnx` with its card and returns the path."""
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
    """Returns the provenance of the model for its card."""
    state = load(folder / "best.pt")
    with (folder / "log.csv").open() as file:
        rows = list(csv.DictReader(file))
    best = next(row for row in rows if int(row["step"]) == state["step"])
    training = state["meaning"]["training"]
    chosen = ("seed", "batch", "epochs", "epoch_pairs", "learning_rate", "angle_weight", "local_weight", "mixed_precision")
    return {
        "command": f"python -m gyre_training reproduce research/training/recipes/{recipe.name}.toml",
        "data": data(scans),
        "trajectories": sorted({file for world in worlds_of("train") if (file := followed(world))}),
        "gyre": " ".join(filter(None, (scans.settings["version"], scans.settings.get("commit")))),
        "initial": recipe.initial or "",
        "teacher": recipe.teacher or "",
        "scans": len(scans.records),
        **{key: training[key] for key in chosen},
        "best_epoch": int(best["epoch"]),
        "validation_translation_percent": float(best["translation_percent"]),
        "validation_rotation_deg_per_100m": float(best["rotation_deg_per_100m"]),
        "minutes": round(float(rows[-1]["seconds"]) / 60, 1),
        "machine": state["machine"],
        "torch": state["torch"],
    }


def data(scans: Scans) -> str:
    """Returns the source of the scans. Simulated ones have the names of worlds."""
    names = [sequence["name"] for sequence in scans.settings["sequences"]]
    others = sorted(set(names) - {world.stem for world in worlds_of("train")})
    return f"recordings: {', '.join(others)}" if others else "simulated only: research/training/worlds/train"
