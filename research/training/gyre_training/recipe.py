"""Recipes: the files of `recipes/`, each with all settings of a model."""

import math
import tomllib
from dataclasses import dataclass, fields
from pathlib import Path

from .network import NetworkConfig
from .pairs import Sampling
from .search import SearchConfig
from .train import TrainingConfig

HOME = Path(__file__).resolve().parent.parent
PROJECT = HOME.parent.parent


@dataclass(frozen=True)
class Recipe:
    """The settings of a model. `raster` names a file of `rasters/`: the Gyre configuration of its input."""

    name: str
    raster: str
    network: NetworkConfig
    training: TrainingConfig
    # The recipe whose best weights initialise the network, or an ONNX file in floats (`models/NAME.onnx`, from the project's root).
    initial: str | None = None
    # The recipe whose masks are distilled before the training, and the settings of the distillation.
    teacher: str | None = None
    distillation: TrainingConfig = TrainingConfig()
    # Quantise the model to 8-bit integers.
    integers: bool = False

    def initial_weights(self, runs: Path) -> Path | None:
        """Returns the checkpoint or the ONNX file that initialises the network."""
        if self.initial and self.initial.endswith(".onnx"):
            return PROJECT / self.initial
        return runs / self.initial / "best.pt" if self.initial else None

    @property
    def configuration(self) -> Path:
        return HOME / "rasters" / f"{self.raster}.toml"


# Options of Gyre's search that `ScanMatch` lacks, with the only values that it supports.
FIXED = {
    "rotation": {"phase_only": False},
    "translation": {"phase_only": False},
}


def search_of(settings: dict) -> SearchConfig:
    """Returns the search of the rasters' configuration, as `gyre-lab export-pairs` resolved it. A search that `ScanMatch` does
    not support is refused."""
    rotation, translation = settings["rotation"], settings["translation"]
    for section, fixed in FIXED.items():
        for key, value in fixed.items():
            if settings[section].get(key, value) != value:
                raise SystemExit(f"training does not support {section}.{key} = {settings[section][key]}: set it to {value}")
    if rotation.get("peak") != translation.get("peak"):
        raise SystemExit("training needs one kind of peak: give rotation.peak and translation.peak the same value")
    known = {field.name for field in fields(SearchConfig)}
    values = {key: value for key, value in (translation | rotation).items() if key in known}
    band = values["band_high"] - values["band_low"]
    values.setdefault("radii", max(2, math.ceil(band * settings["raster"]["n"])))
    return SearchConfig(**values)


def read(path: Path) -> Recipe:
    """Reads a recipe; unknown keys are rejected by name."""
    try:
        values = tomllib.loads(path.read_text())
        if "distillation" in values and "teacher" not in values:
            raise ValueError("[distillation] needs a teacher")
        network = NetworkConfig.from_dict({"widths": NetworkConfig.widths} | values.pop("network", {}))
        stages = {stage: training_config(values.pop(stage, {})) for stage in ("training", "distillation")}
        return Recipe(name=path.stem, network=network, **stages, **values)
    except (OSError, TypeError, ValueError) as error:
        raise SystemExit(f"{path} is not a valid recipe: {error}") from error


def training_config(values: dict) -> TrainingConfig:
    """Returns the settings of a section `[training]` or `[distillation]`."""
    return TrainingConfig(**values | {"sampling": Sampling(**values.get("sampling", {}))})


def lineage(path: Path) -> list[Recipe]:
    """Returns a recipe and those that it depends on, in the order of their training."""
    recipe = read(path)
    before = [lineage(path.with_name(f"{name}.toml")) for name in (recipe.teacher, recipe.initial) if name and not name.endswith(".onnx")]
    return list({one.name: one for one in [*sum(before, []), recipe]}.values())
