"""A step of training as one CUDA graph: launching its thousands of kernels one by one takes longer than they do."""

from collections.abc import Callable

import torch
from torch import Tensor

from evimo.training.batches import Batch

WARM_UP = 3  # calls before the capture: what is chosen or allocated at first must be there by then

Pass = Callable[[Batch], Tensor]


def captured(learn: Pass, batch: Batch) -> Pass:
    """The same function of batches of this shape, replayed from a CUDA graph.

    Args:
        learn: a forward and a backward pass; each replay overwrites its result and the gradients it leaves.
        batch: on the CPU or the GPU, without events.

    Raises:
        RuntimeError: the function does what a graph cannot hold.
    """
    buffers = batch.to(torch.device("cuda", torch.cuda.current_device()))
    stream = torch.cuda.Stream()
    stream.wait_stream(torch.cuda.current_stream())
    with torch.cuda.stream(stream):
        for _ in range(WARM_UP):
            learn(buffers)
    torch.cuda.current_stream().wait_stream(stream)
    graph = torch.cuda.CUDAGraph()
    with torch.cuda.graph(graph, capture_error_mode="thread_local"):  # another thread draws batches meanwhile
        result = learn(buffers)

    def replayed(batch: Batch) -> Tensor:
        for buffer, values in zip(buffers[:16], batch[:16], strict=True):
            buffer.copy_(values, non_blocking=True)
        graph.replay()
        return result

    return replayed
