"""Recipes: all that makes a model, in one file of `recipes/`."""

import math
import tomllib
from dataclasses import dataclass, fields
from pathlib import Path

from .network import NetworkConfig
from .pairs import Sampling
from .search import SearchConfig
from .train import TrainingConfig

HOME = Path(__file__).resolve().parent.parent
PROJECT = HOME.parent


@dataclass(frozen=True)
class Recipe:
    """`raster` names the file of `rasters/` that says what the networks look at: a configuration of Gyre."""

    name: str
    raster: str
    network: NetworkConfig
    training: TrainingConfig
    # The recipe whose network this one begins with.
    initial: str | None = None
    # The recipe whose masks the network learns first, and how.
    teacher: str | None = None
    distillation: TrainingConfig = TrainingConfig()
    # Whether the model computes in 8-bit integers.
    integers: bool = False

    @property
    def configuration(self) -> Path:
        return HOME / "rasters" / f"{self.raster}.toml"


# What a search of Gyre may do that `ScanMatch` does not, and the only values that it knows.
FIXED = {
    "rotation": {"magnitude": "linear", "phase_only": False},
    "translation": {"phase_only": False, "half_turn": False},
}


def search_of(settings: dict) -> SearchConfig:
    """The search that the rasters' own configuration describes, as `gyre-lab export-pairs` resolved it. One that networks cannot
    be trained through is refused."""
    rotation, translation = settings["rotation"], settings["translation"]
    for section, fixed in FIXED.items():
        for key, value in fixed.items():
            if settings[section].get(key, value) != value:
                raise SystemExit(f"no network is trained through {section}.{key} = {settings[section][key]}: set it to {value}")
    if rotation.get("peak") != translation.get("peak"):
        raise SystemExit("no network is trained through peaks of two kinds: set rotation.peak and translation.peak alike")
    known = {field.name for field in fields(SearchConfig)}
    values = {key: value for key, value in (translation | rotation).items() if key in known}
    band = values["band_high"] - values["band_low"]
    values.setdefault("radii", max(2, math.ceil(band * settings["raster"]["n"])))
    return SearchConfig(**values)


def read(path: Path) -> Recipe:
    """A recipe; what it cannot say is refused by name."""
    try:
        values = tomllib.loads(path.read_text())
        if "distillation" in values and "teacher" not in values:
            raise ValueError("[distillation] needs a teacher")
        network = NetworkConfig.from_dict({"widths": NetworkConfig.widths} | values.pop("network", {}))
        stages = {stage: training_config(values.pop(stage, {})) for stage in ("training", "distillation")}
        return Recipe(name=path.stem, network=network, **stages, **values)
    except (OSError, TypeError, ValueError) as error:
        raise SystemExit(f"{path} is no recipe: {error}") from error


def training_config(values: dict) -> TrainingConfig:
    """A section `[training]` or `[distillation]`."""
    return TrainingConfig(**values | {"sampling": Sampling(**values.get("sampling", {}))})


def lineage(path: Path) -> list[Recipe]:
    """A recipe after those that it builds upon, the first one first."""
    recipe = read(path)
    before = [lineage(path.with_name(f"{name}.toml")) for name in (recipe.teacher, recipe.initial) if name]
    return list({one.name: one for one in [*sum(before, []), recipe]}.values())
