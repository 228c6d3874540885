"""Training: Adam on the error of the pose that the search finds in the masked scans (Weston et al., Eq. 12)."""

import csv
import hashlib
import math
import platform
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from .drift import Drift, drift, motions
from .network import MaskNetwork, NetworkConfig
from .pairs import Batch, Sampling, Scans, augmented
from .exhaustive import ExhaustiveMatch
from .search import ScanMatch, SearchConfig


@dataclass(frozen=True)
class TrainingConfig:
    """How long and how to train. `angle_weight` is what a radian counts beside a metre (1 in the papers)."""

    seed: int = 1
    batch: int = 8
    epochs: int = 10
    epoch_pairs: int = 4000
    learning_rate: float = 1e-3
    last_learning_rate: float = 2e-5
    clip: float = 1.0
    angle_weight: float = 1.0
    exhaustive: bool = False
    # The network's features in bfloat16: two thirds of a step's time on processors that compute with it, more on others.
    mixed_precision: bool = False
    augment: bool = True
    # What the error of the highest peak's own place counts beside that of the soft peak, where it is the right peak (0 in
    # the papers). A soft peak is sharp enough to choose among peaks only where it is blind to fractions of a cell.
    local_weight: float = 1.0
    sampling: Sampling = field(default_factory=Sampling)

    def steps_an_epoch(self) -> int:
        return self.epoch_pairs // self.batch


def pose_error(found: Tensor, true: Tensor, angle_weight: float) -> Tensor:
    """The terms of Eq. 12: (batch, 3)."""
    return (found - true).abs() * torch.tensor([1.0, 1.0, angle_weight], device=true.device)


# Epochs count from this part of a training on: before it the learning rate is high, and the epoch that looks best is a lucky one.
SETTLED = 0.8

# What is farther off, along each axis by itself, is another peak: cells and radians.
SAME_PEAK_CELLS, SAME_PEAK_RAD = 1.5, math.radians(1.5)


class Trainer:
    """One training, which may be cut off at any time and goes on from its folder."""

    def __init__(
        self,
        folder: Path,
        scans: Scans,
        validation: Scans,
        network: NetworkConfig,
        search: SearchConfig,
        config: TrainingConfig,
        device: str = "cpu",
        initial: Path | None = None,
    ):
        self.folder, self.scans, self.validation, self.config = folder, scans, validation, config
        self.device = torch.device(device)
        folder.mkdir(parents=True, exist_ok=True)
        torch.manual_seed(config.seed)
        self.network = MaskNetwork(network).to(self.device)
        self.network.mixed_precision = config.mixed_precision
        if initial:
            self.network.load_state_dict(load(initial)["network"])
        match = ExhaustiveMatch if config.exhaustive else ScanMatch
        self.match = match(scans.n, scans.cell_m, search).to(self.device)
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=config.learning_rate)
        self.pairs = config.sampling.pairs(scans, config.seed)
        if not config.steps_an_epoch():
            raise SystemExit(f"an epoch of {config.epoch_pairs} pairs has no batch of {config.batch}")
        self.step, self.seconds, self.best, self.skipped = 0, 0.0, math.inf, 0
        self.meaning = {
            "network": network.to_dict(),
            "search": asdict(search),
            "training": asdict(config),
            "learns_from": {"pairs": scans.fingerprint(), "initial": fingerprint(initial)} | self.others(),
        }
        self._resume()

    def others(self) -> dict[str, str]:
        """What else the training learns from."""
        return {}

    @property
    def steps(self) -> int:
        return self.config.epochs * self.config.steps_an_epoch()

    def run(self) -> None:
        """Trains to the end, an epoch at a time; the best of the last epochs by validation drift is kept in `best.pt`."""
        print(f"{self.network.parameters_count()} parameters, {len(self.pairs)} pairs, {self.steps} steps of "
              f"{self.config.batch}; at step {self.step}", flush=True)
        while self.step < self.steps:
            self._epoch()

    def learning_rate(self) -> float:
        """Half a cosine from the first to the last, after a short rise."""
        config, done = self.config, self.step / self.steps
        rise = min(1.0, (self.step + 1) / 50)
        span = config.learning_rate - config.last_learning_rate
        return rise * (config.last_learning_rate + span * 0.5 * (1 + math.cos(math.pi * done)))

    def _epoch(self) -> None:
        config = self.config
        epoch, began, losses, saved = self.step // config.steps_an_epoch(), time.time(), [], time.time()
        order = np.random.default_rng([config.seed, epoch]).permutation(len(self.pairs))
        self.network.train()
        first = self.step % config.steps_an_epoch()
        for k in range(first, config.steps_an_epoch()):
            at = np.arange(k * config.batch, (k + 1) * config.batch) % len(order)
            losses.append(self._learn(self.pairs[order[at]], np.random.default_rng([config.seed, epoch, k])))
            self.step += 1
            if k == first + 20:
                self._announce((time.time() - began) / 21)
            # Not after an epoch's last step: who goes on from there would miss its validation.
            if time.time() - saved > 60 and k + 1 < config.steps_an_epoch():
                saved = self._save("last.pt", began)
        self.seconds += time.time() - began
        self._finish_epoch(epoch, float(np.mean(losses)))

    def _learn(self, pairs: np.ndarray, rng: np.random.Generator) -> float:
        batch = self.scans.batch(pairs)
        batch = (augmented(batch, rng) if self.config.augment else batch).to(self.device)
        for group in self.optimiser.param_groups:
            group["lr"] = self.learning_rate()
        value = self.loss(batch)
        self.optimiser.zero_grad(set_to_none=True)
        value.backward()
        norm = nn.utils.clip_grad_norm_(self.network.parameters(), self.config.clip)
        if torch.isfinite(norm):
            self.optimiser.step()
            self.network.symmetrise()
        else:
            self.skipped += 1
        return float(value.detach())

    def loss(self, batch: Batch) -> Tensor:
        """Eqs. 9 to 12, and the same of the highest peaks' own places."""
        config, masked = self.config, self.network.masked(batch.later, batch.earlier)
        if config.exhaustive or not config.local_weight:
            return pose_error(self.match(*masked), batch.motion, config.angle_weight).sum(1).mean()
        soft, local = self.match.soft_and_local(*masked)
        cells = SAME_PEAK_CELLS * self.scans.cell_m
        near = (local.detach() - batch.motion).abs() < torch.tensor([cells, cells, SAME_PEAK_RAD], device=self.device)
        soft, local = (pose_error(found, batch.motion, config.angle_weight) for found in (soft, local))
        return (soft + config.local_weight * near * local).sum(1).mean()

    def validate(self) -> Drift:
        """Drift over the validation sequences, by the highest peaks."""
        self.network.eval()
        pairs = self.validation.pairs(1)
        return drift(self.validation, motions(self.validation, pairs, self.network, self.match), pairs)

    def _finish_epoch(self, epoch: int, mean_loss: float) -> None:
        began = time.time()
        result = self.validate()
        self.seconds += time.time() - began
        row = {"epoch": epoch, "step": self.step, "seconds": round(self.seconds, 1), "loss": round(mean_loss, 5)}
        row |= {key: round(value, 5) for key, value in asdict(result).items()}
        self._log(row | {"learning_rate": f"{self.learning_rate():.3g}"})
        better = self.step > SETTLED * self.steps and result.translation_percent < self.best
        if better:
            self.best = result.translation_percent
            self._save("best.pt")
        self._save("last.pt")
        skipped = f", {self.skipped} steps without a finite gradient" if self.skipped else ""
        self.skipped = 0
        print(f"epoch {epoch}: loss {mean_loss:.4f}, validation {result}{' *' if better else ''}, "
              f"{self.seconds / 60:.1f} min{skipped}", flush=True)

    def _announce(self, step_s: float) -> None:
        left = (self.steps - self.step) * step_s
        print(f"{1e3 * step_s:.0f} ms a step ({self.config.batch / step_s:.1f} pairs/s): about {left / 60:.0f} min and "
              f"{self.config.epochs} validations to go", flush=True)

    def _log(self, row: dict) -> None:
        path = self.folder / "log.csv"
        new = not path.exists()
        with path.open("a", newline="") as file:
            writer = csv.DictWriter(file, list(row))
            if new:
                writer.writeheader()
            writer.writerow(row)

    def _save(self, name: str, began: float | None = None) -> float:
        """Writes under another name first: whoever is cut off here finds the file before."""
        now = time.time()
        state = {
            "network": self.network.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "step": self.step,
            "seconds": self.seconds + (now - began if began else 0.0),
            "best": self.best,
            "machine": machine(self.device),
            "torch": str(torch.__version__),
            "meaning": self.meaning,
        }
        path = self.folder / name
        torch.save(state, path.with_suffix(".new"))
        path.with_suffix(".new").replace(path)
        return now

    def _resume(self) -> None:
        path = self.folder / "last.pt"
        if not path.exists():
            return
        state = load(path)
        if filled(state["meaning"], DEFAULTS) != self.meaning:
            raise SystemExit(f"{self.folder} holds another training: give another folder, or delete it")
        self.network.load_state_dict(state["network"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.step, self.seconds, self.best = state["step"], state["seconds"], state["best"]


# What a checkpoint does not say was not there to be chosen when it was written.
DEFAULTS = {"network": NetworkConfig().to_dict(), "search": asdict(SearchConfig()), "training": asdict(TrainingConfig())}


def filled(values: dict, defaults: dict) -> dict:
    """The values, and what they lack of the defaults, section by section."""
    inner = {key: filled(value, defaults.get(key, {})) for key, value in values.items() if isinstance(value, dict)}
    return defaults | values | inner


def fingerprint(checkpoint: Path | None) -> str:
    """What tells a checkpoint's network from others."""
    if not checkpoint:
        return ""
    digest = hashlib.sha256()
    for weights in load(checkpoint)["network"].values():
        digest.update(weights.numpy().tobytes())
    return digest.hexdigest()


def machine(device: torch.device) -> str:
    """Whom a training's time is the time of."""
    if device.type == "cuda":
        return torch.cuda.get_device_name(device)
    threads = torch.get_num_threads()
    return f"{platform.machine()}, {threads} thread{'s' if threads > 1 else ''}"


def load(path: Path) -> dict:
    """A checkpoint."""
    if not path.exists():
        raise SystemExit(f"there is no {path}: train the recipe of that name first")
    return torch.load(path, map_location="cpu", weights_only=True)


def trained(path: Path) -> MaskNetwork:
    """The network of a checkpoint, ready to mask."""
    state = load(path)
    network = MaskNetwork(NetworkConfig.from_dict(state["meaning"]["network"]))
    network.load_state_dict(state["network"])
    return network.eval()
