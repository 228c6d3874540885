"""The command line."""

import argparse
from pathlib import Path

import torch

from . import recipe as recipes
from .drift import drift, motions
from .pairs import Scans
from .search import ScanMatch
from .train import Trainer, trained


def run(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(prog="python -m gyre_training", description=__doc__)
    parser.add_argument("--threads", type=int, help="threads of PyTorch; all by default")
    commands = parser.add_subparsers(required=True)

    command = commands.add_parser("train", help="train a recipe, or go on with it")
    command.add_argument("recipe", type=Path)
    command.add_argument("--pairs", type=Path, required=True, help="folder with train.npy and validation.npy")
    command.add_argument("--out", type=Path, required=True)
    command.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    command.set_defaults(run=train)

    command = commands.add_parser("drift", help="drift of a checkpoint, and without masks")
    command.add_argument("checkpoint", type=Path, nargs="*")
    command.add_argument("--pairs", type=Path, required=True, help="a file of scans")
    command.set_defaults(run=show_drift)

    options = parser.parse_args(arguments)
    if options.threads:
        torch.set_num_threads(options.threads)
    options.run(options)


def train(options: argparse.Namespace) -> None:
    recipe = recipes.read(options.recipe)
    scans, validation = (Scans(options.pairs / f"{split}.npy") for split in ("train", "validation"))
    search = recipes.search_of(scans.settings, recipe.temperature)
    Trainer(options.out, scans, validation, recipe.network, search, recipe.training, options.device).run()


def show_drift(options: argparse.Namespace) -> None:
    scans = Scans(options.pairs)
    pairs = scans.pairs(1)
    match = ScanMatch(scans.n, scans.cell_m, recipes.search_of(scans.settings))
    for path in [None, *options.checkpoint]:
        network = trained(path) if path else None
        print(f"{path or 'without masks'}: {drift(scans, motions(scans, pairs, network, match), pairs)}", flush=True)
