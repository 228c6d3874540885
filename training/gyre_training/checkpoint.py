"""Less memory for more time: what lies between a block's inputs and outputs is not kept for the way back but computed again.

A network's activations are most of what a training holds. The gradients stay the same to the bit."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

from torch import Tensor, nn
from torch.nn.modules.batchnorm import _BatchNorm
from torch.utils.checkpoint import checkpoint


def recomputed(block: nn.Module, function: Callable[..., Tensor], *inputs: Tensor) -> Tensor:
    """`function(*inputs)`, which runs `block`, of which only the inputs are kept."""
    contexts = lambda: (nullcontext(), counted_once(block))  # noqa: E731
    return checkpoint(function, *inputs, use_reentrant=False, preserve_rng_state=False, context_fn=contexts)


@contextmanager
def counted_once(block: nn.Module) -> Iterator[None]:
    """Batch norms leave their running means as they are: a batch that is run twice is to count once."""
    norms = [module for module in block.modules() if isinstance(module, _BatchNorm)]
    before = [(norm.momentum, norm.num_batches_tracked) for norm in norms]
    for norm in norms:
        norm.momentum, norm.num_batches_tracked = 0.0, None
    try:
        yield
    finally:
        for norm, (momentum, count) in zip(norms, before, strict=True):
            norm.momentum, norm.num_batches_tracked = momentum, count
