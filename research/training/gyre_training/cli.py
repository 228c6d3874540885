"""The command line."""

import argparse
from pathlib import Path

import torch

from . import recipe as recipes
from . import changes, compare, objects, step_time
from .distil import Distiller
from .drift import drift, motions
from .export import OnnxMasks
from .model import publish
from .pairs import Scans
from .plots import training_log
from .search import ScanMatch
from .train import Trainer, trained
from .worlds import export_pairs, find_gyre_lab, simulate


def run(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m gyre_training", description="Trains the mask networks of Gyre.")
    parser.add_argument("--threads", type=int, help="PyTorch threads (default: all)")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--checkpoint", action="store_true", help="activation checkpointing: less memory, more time, same weights")
    commands = parser.add_subparsers(required=True)
    add_reproduce(commands)
    add_train(commands)
    add_publish(commands)
    add_drift(commands)
    add_plot(commands)
    compare.register(commands)
    step_time.register(commands)
    objects.register(commands)
    changes.register(commands)
    options = parser.parse_args(arguments)
    if options.threads:
        torch.set_num_threads(options.threads)
    options.run(options)


def add_reproduce(commands) -> None:
    command = commands.add_parser("reproduce", help="worlds, pairs, training (also of the recipes it starts from), ONNX file and card")
    command.add_argument("recipe", type=Path)
    add_work(command)
    add_models(command)
    command.add_argument("--gyre-lab", type=Path, help="the program gyre-lab (default: the build of this repository)")
    command.set_defaults(run=reproduce)


def add_work(command) -> None:
    command.add_argument("--work", type=Path, default=Path("out/training"), help="folder of worlds/, pairs/RASTER/ and runs/NAME/, which are reused")


def add_models(command) -> None:
    command.add_argument("--models", type=Path, default=Path("out/models"), help="output folder of the model")


def reproduce(options: argparse.Namespace) -> None:
    gyre_lab, work = find_gyre_lab(options.gyre_lab), options.work.resolve()
    simulate(work / "worlds")
    for recipe in recipes.lineage(options.recipe):
        pairs = work / "pairs" / recipe.raster
        export_pairs(gyre_lab, work / "worlds", recipe.configuration, pairs)
        folder = train_recipe(recipe, pairs, work, options)
    publish(recipe, folder, pairs, options.models)


def add_train(commands) -> None:
    command = commands.add_parser("train", help="train a recipe on existing pairs, or resume its training")
    command.add_argument("recipe", type=Path)
    add_work(command)
    command.set_defaults(run=train)


def train(options: argparse.Namespace) -> None:
    recipe = recipes.read(options.recipe)
    train_recipe(recipe, options.work / "pairs" / recipe.raster, options.work, options)


def train_recipe(recipe: recipes.Recipe, pairs: Path, work: Path, options: argparse.Namespace) -> Path:
    """Trains a recipe and returns the folder of the run."""
    scans, validation = (Scans(pairs / f"{split}.npy") for split in ("train", "validation"))
    search = recipes.search_of(scans.settings)
    runs = work / "runs"
    initial = recipe.initial_weights(runs)
    common = scans, validation, recipe.network, search
    if recipe.teacher:
        folder, teacher = runs / f"{recipe.name}-distilled", runs / recipe.teacher / "best.pt"
        finish(Distiller(teacher, folder, *common, recipe.distillation, options.device, initial), options)
        initial = folder / "best.pt"
    folder = runs / recipe.name
    finish(Trainer(folder, *common, recipe.training, options.device, initial), options)
    return folder


def finish(trainer: Trainer, options: argparse.Namespace) -> None:
    trainer.network.checkpoint = options.checkpoint
    trainer.run()


def add_publish(commands) -> None:
    command = commands.add_parser("publish", help="write the model of a finished training")
    command.add_argument("recipe", type=Path, nargs="+")
    add_work(command)
    add_models(command)
    command.set_defaults(run=publish_runs)


def publish_runs(options: argparse.Namespace) -> None:
    for path in options.recipe:
        recipe = recipes.read(path)
        work: Path = options.work
        publish(recipe, work / "runs" / recipe.name, work / "pairs" / recipe.raster, options.models)


def add_drift(commands) -> None:
    command = commands.add_parser("drift", help="drift with the masks of checkpoints and ONNX files, and without masks")
    command.add_argument("checkpoint", type=Path, nargs="*")
    command.add_argument("--scans", type=Path, required=True, help="a file written by gyre-lab export-pairs")
    command.set_defaults(run=show_drift)


def show_drift(options: argparse.Namespace) -> None:
    scans = Scans(options.scans)
    pairs = scans.pairs(1)
    match = ScanMatch(scans.n, scans.cell_m, recipes.search_of(scans.settings)).to(options.device)
    for path in [None, *options.checkpoint]:
        network = masks_of(path, options.device) if path else None
        print(f"{path or 'without masks'}: {drift(scans, motions(scans, pairs, network, match), pairs)}", flush=True)


def masks_of(path: Path, device: str):
    return OnnxMasks(path) if path.suffix == ".onnx" else trained(path).to(device)


def add_plot(commands) -> None:
    command = commands.add_parser("plot", help="plot the log.csv of a run as log.svg")
    command.add_argument("folder", type=Path, nargs="+", help="the folder of a run")
    command.set_defaults(run=plot)


def plot(options: argparse.Namespace) -> None:
    for folder in options.folder:
        print(training_log(folder))
