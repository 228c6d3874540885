"""Distillation: a network learns the masks of a teacher before it is trained through the search."""

from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor

from .pairs import Batch
from .train import Trainer, fingerprint, trained


class Distiller(Trainer):
    """A training whose loss is the distance of the masks from those of a teacher: a pose gives three numbers a pair, a
    teacher one for each cell."""

    def __init__(self, teacher: Path, *arguments, **options):
        self.teacher, self.taught_by = trained(teacher), fingerprint(teacher)
        super().__init__(*arguments, **options)
        self.teacher.to(self.device)

    def others(self) -> dict[str, str]:
        return {"teacher": self.taught_by}

    def loss(self, batch: Batch) -> Tensor:
        """Returns the cross entropy, weighted by the power of each cell: the mask of an empty cell does not matter."""
        scans = torch.stack([batch.later, batch.earlier], 1)
        with torch.no_grad():
            masks = torch.sigmoid(self.teacher.logits_of_pairs(scans))
        power = scans / scans.mean((2, 3), keepdim=True).clamp(min=1e-6)
        return F.binary_cross_entropy_with_logits(self.network.logits_of_pairs(scans), masks, power)
