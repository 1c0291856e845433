"""Where a run trains: a CPU, or an NVIDIA GPU; alone or as one of the processes that torchrun started."""

import os
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import torch
from torch import Tensor, distributed

from evimo.errors import BadInput


@dataclass(frozen=True)
class Team:
    """The processes that train one model together, each on its share of every batch.

    rank: this process's number; 0 alone writes files. size: how many there are.
    """

    rank: int = 0
    size: int = 1

    def places(self, batch: int) -> range:
        """This process's places in a batch, of 0...batch - 1."""
        return range(self.rank, batch, self.size)

    def sum(self, tensors: Sequence[Tensor]) -> None:
        """Replace each tensor by its sum over all processes."""
        if self.size == 1:
            return
        joined = torch.cat([tensor.detach().flatten() for tensor in tensors])
        distributed.all_reduce(joined)
        for tensor, total in zip(tensors, joined.split([tensor.numel() for tensor in tensors]), strict=True):
            tensor.copy_(total.view_as(tensor))

    def wait(self) -> None:
        """Return when all processes have come here."""
        if self.size > 1:
            distributed.barrier()


ALONE = Team()


def training_device(name: str) -> str:
    """The torch device that `cpu` or `cuda` means for this process: each process of a machine has its own GPU.

    Raises:
        BadInput: it is neither, or PyTorch finds no GPU, or fewer than processes.
    """
    if name not in ("cpu", "cuda"):
        raise BadInput(f"no device {name!r}", fix="cpu or cuda")
    if name == "cpu":
        return name
    if not torch.cuda.is_available():
        raise BadInput("no NVIDIA GPU that PyTorch can use", fix="--device cpu, or see what nvidia-smi says")
    number = int(os.environ.get("LOCAL_RANK", "0"))
    if number >= torch.cuda.device_count():
        raise BadInput(
            f"{number + 1} processes for {torch.cuda.device_count()} GPUs", fix="torchrun --nproc-per-node GPUS"
        )
    torch.cuda.set_device(number)
    return f"cuda:{number}"


@contextmanager
def joined_team(device: str) -> Generator[Team]:
    """The team that torchrun started, for as long as the `with` lasts; without torchrun, this process alone."""
    if int(os.environ.get("WORLD_SIZE", "1")) == 1:
        yield ALONE
        return
    distributed.init_process_group("nccl" if device.startswith("cuda") else "gloo")
    try:
        yield Team(distributed.get_rank(), distributed.get_world_size())
    finally:
        distributed.destroy_process_group()
