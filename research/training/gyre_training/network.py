"""The mask networks: the U-Net of Weston et al., Table II, and lighter variants."""

from collections.abc import Callable
from dataclasses import asdict, dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .checkpoint import recomputed
from .exchange import symmetrise
from .polar import to_polar, to_raster

# Rasters have powers of 0 to 255.
FULL_SCALE = 255.0


@dataclass(frozen=True)
class NetworkConfig:
    """A U-Net of `inputs` scans (2: the later and the earlier one together; 1: each scan by itself).

    `widths` are the features of the levels, each at half the resolution of the one before. `shrink = 2` computes masks at
    half the resolution and upsamples them. `fold = 4` makes each square of 4 x 4 cells one cell of 16 features
    (space-to-depth) and unfolds the masks at the end: no detail is lost, and each convolution has a sixteenth of the cells.
    `separable` uses depthwise separable convolutions. `polar` resamples to azimuth and range. Networks of two scans are
    symmetric (`exchange.py`).
    """

    inputs: int = 2
    widths: tuple[int, ...] = (8, 16, 32, 64, 128, 256)
    shrink: int = 1
    fold: int = 1
    separable: bool = False
    polar: bool = False

    def __post_init__(self):
        if self.inputs == 2 and any(width % 2 for width in self.widths):
            raise ValueError(f"a network of two scans has half of its features for each: widths {self.widths} must be even")

    def to_dict(self) -> dict:
        return asdict(self) | {"widths": list(self.widths)}

    @staticmethod
    def from_dict(values: dict) -> "NetworkConfig":
        return NetworkConfig(**values | {"widths": tuple(values["widths"])})


def convolution(inputs: int, outputs: int, separable: bool) -> nn.Module:
    """Returns a 3 x 3 convolution with batch norm and ReLU."""
    if separable and inputs >= 8:
        layers = [
            nn.Conv2d(inputs, inputs, 3, padding=1, groups=inputs, bias=False),
            nn.Conv2d(inputs, outputs, 1, bias=False),
        ]
    else:
        layers = [nn.Conv2d(inputs, outputs, 3, padding=1, bias=False)]
    return nn.Sequential(*layers, nn.BatchNorm2d(outputs), nn.ReLU(inplace=True))


def block(inputs: int, outputs: int, separable: bool) -> nn.Module:
    return nn.Sequential(convolution(inputs, outputs, separable), convolution(outputs, outputs, separable))


def joined(x: Tensor, skip: Tensor) -> Tensor:
    """Returns the upsampled features of the level below, concatenated with the skip connection. Odd sizes are halved
    downward, so the features are upsampled to the size of the skip."""
    return torch.cat([F.interpolate(x, size=skip.shape[-2:], mode="bilinear", align_corners=False), skip], 1)


class MaskNetwork(nn.Module):
    """Masks of scans (Eq. 9): powers (batch, inputs, n, n) to factors of 0 to 1 of the same shape."""

    def __init__(self, config: NetworkConfig = NetworkConfig()):
        super().__init__()
        self.config = config
        self.checkpoint = False  # in training only: less memory, more time
        self.mixed_precision = False  # in training only: features in bfloat16
        widths, separable = config.widths, config.separable
        folded = config.inputs * config.fold**2
        pairs = zip((folded, *widths), widths)
        self.encoder = nn.ModuleList(block(i, o, separable) for i, o in pairs)
        pairs = zip(reversed(widths[1:]), reversed(widths[:-1]))
        self.decoder = nn.ModuleList(block(i + o, o, separable) for i, o in pairs)
        self.masks = nn.Conv2d(widths[0], folded, 3, padding=1)
        self.symmetrise()
        # Channels last: a third faster on a CPU.
        self.to(memory_format=torch.channels_last)

    def forward(self, scans: Tensor) -> Tensor:
        return torch.sigmoid(self.logits(scans))

    def logits(self, scans: Tensor) -> Tensor:
        """Returns the masks before the sigmoid."""
        if not (self.mixed_precision and self.training):
            return self._logits(scans)
        with torch.autocast(scans.device.type, torch.bfloat16):
            return self._logits(scans).float()

    def _logits(self, scans: Tensor) -> Tensor:
        x, size, config = scans / FULL_SCALE, scans.shape[-1], self.config
        if config.polar:
            x = to_polar(x)
        inner = x.shape[-2:]
        if config.shrink > 1:
            x = F.avg_pool2d(x, config.shrink)
        if config.fold > 1:
            x = F.pixel_unshuffle(F.pad(x, (0, -x.shape[-1] % config.fold, 0, -x.shape[-2] % config.fold)), config.fold)
        x = self.masks(self._features(x))
        if config.fold > 1:
            x = F.pixel_shuffle(x, config.fold)
        if config.shrink > 1:
            x = F.interpolate(x, size=inner, mode="bilinear", align_corners=False)
        x = x[..., : inner[0], : inner[1]]
        return to_raster(x, size) if config.polar else x

    def _features(self, x: Tensor) -> Tensor:
        skips = []
        for encode in self.encoder:
            x = self._run(encode, lambda x, encode=encode, pool=bool(skips): encode(F.max_pool2d(x, 2) if pool else x), x)
            skips.append(x)
        skips.pop()
        for decode in self.decoder:
            x = self._run(decode, lambda x, skip, decode=decode: decode(joined(x, skip)), x, skips.pop())
        return x

    def _run(self, block: nn.Module, function: Callable[..., Tensor], *inputs: Tensor) -> Tensor:
        if self.checkpoint and self.training:
            return recomputed(block, function, *inputs)
        return function(*inputs)

    def masked(self, later: Tensor, earlier: Tensor) -> tuple[Tensor, Tensor]:
        """Returns both scans (batch, n, n) multiplied with their masks (Eq. 10)."""
        scans = torch.stack([later, earlier], 1)
        return tuple((scans * torch.sigmoid(self.logits_of_pairs(scans))).unbind(1))

    def logits_of_pairs(self, scans: Tensor) -> Tensor:
        """Returns the logits of pairs (batch, 2, n, n), for networks of two scans and of single scans."""
        if self.config.inputs == 1:
            return self.logits(scans.flatten(0, 1)[:, None]).view_as(scans)
        return self.logits(scans)

    def symmetrise(self) -> None:
        """Makes a network of two scans symmetric. Call it after each change of the weights."""
        if self.config.inputs == 1:
            return
        widths = self.config.widths
        for encode, inputs in zip(self.encoder, (self.masks.out_channels, *widths)):
            symmetrise(encode, [inputs])
        for decode, above, skipped in zip(self.decoder, reversed(widths[1:]), reversed(widths[:-1])):
            symmetrise(decode, [above, skipped])
        symmetrise(self.masks, [widths[0]])

    def parameters_count(self) -> int:
        return sum(parameter.numel() for parameter in self.parameters())
