"""Training: Adam on the pose error of the search with masked scans (Weston et al., Eqs. 9 to 12)."""

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
from .published import restore
from .exhaustive import ExhaustiveMatch
from .search import ScanMatch, SearchConfig


@dataclass(frozen=True)
class TrainingConfig:
    """The settings of a training. `angle_weight` is the weight of a radian relative to a metre (1 in the papers)."""

    seed: int = 1
    batch: int = 8
    epochs: int = 10
    epoch_pairs: int = 4000
    learning_rate: float = 1e-3
    last_learning_rate: float = 2e-5
    clip: float = 1.0
    angle_weight: float = 1.0
    exhaustive: bool = False
    # Features in bfloat16: two thirds of the step time on processors that support it, slower on others.
    mixed_precision: bool = False
    augment: bool = True
    # Weight of the error of the highest peak, if it is the right one, relative to the error of the soft-argmax (0 in the
    # papers). A soft-argmax that is sharp enough to select a peak has no gradient within a cell.
    local_weight: float = 1.0
    sampling: Sampling = field(default_factory=Sampling)

    def steps_an_epoch(self) -> int:
        return self.epoch_pairs // self.batch


def pose_error(found: Tensor, true: Tensor, angle_weight: float) -> Tensor:
    """Returns the terms of Eq. 12: (batch, 3)."""
    return (found - true).abs() * torch.tensor([1.0, 1.0, angle_weight], device=true.device)


# The best epoch is chosen from this share of the training on: earlier the learning rate is high, and a low validation drift
# is chance.
SETTLED = 0.8

# Scans over which the statistics of a published model are measured.
EXAMPLES = 16

# The largest error of the right peak along each axis, cells and rad.
SAME_PEAK_CELLS, SAME_PEAK_RAD = 1.5, math.radians(1.5)


class Trainer:
    """A training that may be interrupted at any time and is resumed from its folder."""

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
        if initial and initial.suffix == ".onnx":
            restore(self.network, initial, scans.examples(network.inputs, EXAMPLES))
        elif initial:
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
        """Returns further inputs of the training that identify it."""
        return {}

    @property
    def steps(self) -> int:
        return self.config.epochs * self.config.steps_an_epoch()

    def run(self) -> None:
        """Trains all epochs; `best.pt` is the one of the last epochs with the least validation drift."""
        print(f"{self.network.parameters_count()} parameters, {len(self.pairs)} pairs, {self.steps} steps of "
              f"{self.config.batch}; at step {self.step}", flush=True)
        while self.step < self.steps:
            self._epoch()

    def learning_rate(self) -> float:
        """Returns the learning rate: a short warm-up, then a cosine decay."""
        config, done = self.config, self.step / self.steps
        warm_up = min(1.0, (self.step + 1) / 50)
        span = config.learning_rate - config.last_learning_rate
        return warm_up * (config.last_learning_rate + span * 0.5 * (1 + math.cos(math.pi * done)))

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
            # Not after the last step of an epoch: resuming there would skip its validation.
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
        """Returns the loss of Eqs. 9 to 12, plus that of the highest peaks."""
        config, masked = self.config, self.network.masked(batch.later, batch.earlier)
        if config.exhaustive or not config.local_weight:
            return pose_error(self.match(*masked), batch.motion, config.angle_weight).sum(1).mean()
        soft, local = self.match.soft_and_local(*masked)
        cells = SAME_PEAK_CELLS * self.scans.cell_m
        near = (local.detach() - batch.motion).abs() < torch.tensor([cells, cells, SAME_PEAK_RAD], device=self.device)
        soft, local = (pose_error(found, batch.motion, config.angle_weight) for found in (soft, local))
        return (soft + config.local_weight * near * local).sum(1).mean()

    def validate(self) -> Drift:
        """Returns the drift of the validation sequences, by the highest peaks."""
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
        """Writes a checkpoint atomically (another name, then a rename) and returns the time."""
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
            raise SystemExit(f"{self.folder} holds another training: choose another folder, or delete it")
        self.network.load_state_dict(state["network"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.step, self.seconds, self.best = state["step"], state["seconds"], state["best"]


# Keys that a checkpoint lacks did not exist when it was written: they have their defaults.
DEFAULTS = {"network": NetworkConfig().to_dict(), "search": asdict(SearchConfig()), "training": asdict(TrainingConfig())}


def filled(values: dict, defaults: dict) -> dict:
    """Returns the values, completed with the defaults section by section."""
    inner = {key: filled(value, defaults.get(key, {})) for key, value in values.items() if isinstance(value, dict)}
    return defaults | values | inner


def fingerprint(checkpoint: Path | None) -> str:
    """Returns a hash of the weights of a checkpoint or of an ONNX file, empty without one."""
    if not checkpoint:
        return ""
    if checkpoint.suffix == ".onnx":
        return hashlib.sha256(checkpoint.read_bytes()).hexdigest()
    digest = hashlib.sha256()
    for weights in load(checkpoint)["network"].values():
        digest.update(weights.numpy().tobytes())
    return digest.hexdigest()


def machine(device: torch.device) -> str:
    """Returns the name of the device, for the training time in the model card."""
    if device.type == "cuda":
        return torch.cuda.get_device_name(device)
    threads = torch.get_num_threads()
    return f"{platform.machine()}, {threads} thread{'s' if threads > 1 else ''}"


def load(path: Path) -> dict:
    """Loads a checkpoint."""
    if not path.exists():
        raise SystemExit(f"{path} does not exist: train the recipe of that name first")
    return torch.load(path, map_location="cpu", weights_only=True)


def trained(path: Path) -> MaskNetwork:
    """Returns the network of a checkpoint for inference."""
    state = load(path)
    network = MaskNetwork(NetworkConfig.from_dict(state["meaning"]["network"]))
    network.load_state_dict(state["network"])
    return network.eval()
