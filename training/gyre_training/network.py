"""The masking networks: Weston et al., Table II, and lighter ones of the same shape."""

from collections.abc import Callable
from dataclasses import asdict, dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .checkpoint import recomputed

# Rasters hold powers above a floor, 0 to 255.
FULL_SCALE = 255.0


@dataclass(frozen=True)
class NetworkConfig:
    """A U-Net over `inputs` scans (2: the later and the earlier one; 1: each on its own).

    `widths` are the features of the levels, each half the size of the one before. With `shrink` of 2 the masks are
    computed at half the resolution and enlarged. `separable` blocks filter each feature on its own, then mix them.
    """

    inputs: int = 2
    widths: tuple[int, ...] = (8, 16, 32, 64, 128, 256)
    shrink: int = 1
    separable: bool = False

    def to_dict(self) -> dict:
        return asdict(self) | {"widths": list(self.widths)}

    @staticmethod
    def from_dict(values: dict) -> "NetworkConfig":
        return NetworkConfig(**values | {"widths": tuple(values["widths"])})


def convolution(inputs: int, outputs: int, separable: bool) -> nn.Module:
    """3 x 3, batch norm, ReLU."""
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
    """What comes up from the level below, beside what was skipped to here. Odd sizes are halved downward, so the way back
    goes to the skip's own size."""
    return torch.cat([F.interpolate(x, size=skip.shape[-2:], mode="bilinear", align_corners=False), skip], 1)


class MaskNetwork(nn.Module):
    """Masks of scans, Eq. 9: (batch, inputs, n, n) of powers to the same shape of factors between 0 and 1."""

    def __init__(self, config: NetworkConfig = NetworkConfig()):
        super().__init__()
        self.config = config
        self.checkpoint = False  # while training: less memory, more time
        widths, separable = config.widths, config.separable
        pairs = zip((config.inputs, *widths), widths)
        self.encoder = nn.ModuleList(block(i, o, separable) for i, o in pairs)
        pairs = zip(reversed(widths[1:]), reversed(widths[:-1]))
        self.decoder = nn.ModuleList(block(i + o, o, separable) for i, o in pairs)
        self.masks = nn.Conv2d(widths[0], config.inputs, 3, padding=1)
        # A place's features beside each other: a third faster on a CPU.
        self.to(memory_format=torch.channels_last)

    def forward(self, scans: Tensor) -> Tensor:
        return torch.sigmoid(self.logits(scans))

    def logits(self, scans: Tensor) -> Tensor:
        """What the sigmoid is taken of."""
        size, x = scans.shape[-2:], scans / FULL_SCALE
        if self.config.shrink > 1:
            x = F.avg_pool2d(x, self.config.shrink)
        skips = []
        for encode in self.encoder:
            x = self._run(encode, lambda x, encode=encode, pool=bool(skips): encode(F.max_pool2d(x, 2) if pool else x), x)
            skips.append(x)
        skips.pop()
        for decode in self.decoder:
            x = self._run(decode, lambda x, skip, decode=decode: decode(joined(x, skip)), x, skips.pop())
        x = self.masks(x)
        if self.config.shrink > 1:
            x = F.interpolate(x, size=size, mode="bilinear", align_corners=False)
        return x

    def _run(self, block: nn.Module, function: Callable[..., Tensor], *inputs: Tensor) -> Tensor:
        if self.checkpoint and self.training:
            return recomputed(block, function, *inputs)
        return function(*inputs)

    def masked(self, later: Tensor, earlier: Tensor) -> tuple[Tensor, Tensor]:
        """Both scans (batch, n, n) as their masks leave them (Eq. 10)."""
        scans = torch.stack([later, earlier], 1)
        if self.config.inputs == 1:
            masks = self(scans.flatten(0, 1)[:, None]).view_as(scans)
        else:
            masks = self(scans)
        return tuple((scans * masks).unbind(1))

    def parameters_count(self) -> int:
        return sum(parameter.numel() for parameter in self.parameters())
