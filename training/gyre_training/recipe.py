"""Recipes: all that makes a model, in one file of `recipes/`."""

import math
import tomllib
from dataclasses import dataclass, fields
from pathlib import Path

from .network import NetworkConfig
from .pairs import Sampling
from .search import SearchConfig, SoftArgmax
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
    temperature: float = SoftArgmax.temperature
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


def search_of(settings: dict, temperature: float = SoftArgmax.temperature) -> SearchConfig:
    """The search that the rasters' own configuration describes, as `gyre export-pairs` resolved it."""
    n, known = settings["raster"]["n"], {field.name for field in fields(SearchConfig)}
    sections = settings["translation"] | settings["rotation"] | {"overlap": settings["translation"]["overlap"]}
    values = {key: value for key, value in sections.items() if key in known}
    band = values["band_high"] - values["band_low"]
    values.setdefault("radii", max(2, math.ceil(band * n)))
    return SearchConfig(**values, soft=SoftArgmax(temperature))


def read(path: Path) -> Recipe:
    """A recipe; keys that it does not know are refused by name."""
    values = tomllib.loads(path.read_text())
    training, distillation = values.pop("training", {}), values.pop("distillation", {})
    sampling = Sampling(**training.pop("sampling", {}))
    network = values.pop("network", {})
    return Recipe(
        name=path.stem,
        network=NetworkConfig.from_dict({"widths": NetworkConfig.widths} | network),
        training=TrainingConfig(**training, sampling=sampling),
        distillation=TrainingConfig(**distillation, sampling=sampling),
        **values,
    )


def lineage(path: Path) -> list[Recipe]:
    """A recipe after those that it builds upon, the first one first."""
    recipe = read(path)
    before = [lineage(path.with_name(f"{name}.toml")) for name in (recipe.teacher, recipe.initial) if name]
    return list({one.name: one for one in [*sum(before, []), recipe]}.values())
