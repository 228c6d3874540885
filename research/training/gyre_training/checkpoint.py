"""Activation checkpointing: the activations of a block are recomputed in the backward pass instead of stored.

Activations are most of a training's memory. The gradients are bit-identical."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

from torch import Tensor, nn
from torch.nn.modules.batchnorm import _BatchNorm
from torch.utils.checkpoint import checkpoint


def recomputed(block: nn.Module, function: Callable[..., Tensor], *inputs: Tensor) -> Tensor:
    """Returns `function(*inputs)`, which runs `block`; only the inputs are stored."""
    contexts = lambda: (nullcontext(), counted_once(block))  # noqa: E731
    return checkpoint(function, *inputs, use_reentrant=False, preserve_rng_state=False, context_fn=contexts)


@contextmanager
def counted_once(block: nn.Module) -> Iterator[None]:
    """Freezes the running statistics of batch norms, so that a batch that is run twice counts once."""
    norms = [module for module in block.modules() if isinstance(module, _BatchNorm)]
    before = [(norm.momentum, norm.num_batches_tracked) for norm in norms]
    for norm in norms:
        norm.momentum, norm.num_batches_tracked = 0.0, None
    try:
        yield
    finally:
        for norm, (momentum, count) in zip(norms, before, strict=True):
            norm.momentum, norm.num_batches_tracked = momentum, count
