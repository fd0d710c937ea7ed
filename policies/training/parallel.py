"""Several processes that train one network, as torchrun starts them: each plays its own rows; gradients are averaged."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

import torch
import torch.distributed as dist
from torch import Tensor

from arena.errors import InputError

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Processes:
    """Which of how many processes this one is."""

    rank: int = 0
    n: int = 1

    @property
    def is_first(self) -> bool:
        """Whether this one writes the files."""
        return self.rank == 0

    def share(self, total: int) -> tuple[int, int]:
        """Return first and number of this process's part of `total`."""
        first, last = (total * rank // self.n for rank in (self.rank, self.rank + 1))
        return first, last - first

    def mean(self, values: Tensor) -> Tensor:
        """Return the mean of a tensor over the processes."""
        if self.n > 1:
            dist.all_reduce(values)
            values /= self.n
        return values

    def average_gradients(self, parameters: Iterable[Tensor]) -> None:
        """Put the mean of the gradients into each process, in one message."""
        if self.n == 1:
            return
        mine = list(parameters)
        for one in mine:
            if one.grad is None:  # a head without units in this part of the rows
                one.grad = torch.zeros_like(one)
        grads = [one.grad for one in mine if one.grad is not None]
        flat = torch.cat([grad.reshape(-1) for grad in grads])
        dist.all_reduce(flat)
        flat /= self.n
        for grad, mean in zip(grads, torch.split(flat, [grad.numel() for grad in grads]), strict=True):
            grad.copy_(mean.view(grad.shape))

    def gather(self, value: T) -> list[T]:
        """Return the value of every process, in their order."""
        if self.n == 1:
            return [value]
        gathered = [value] * self.n
        dist.all_gather_object(gathered, value)
        return gathered

    def share_first(self, value: T) -> T:
        """Return the value of the first process."""
        return self.gather(value)[0]


def join_processes(device: str = "cpu") -> Processes:
    """Return this process's place among those that torchrun started; or the only place.

    They are connected by gloo, and where the networks compute on GPUs, one for each process of a machine, also by nccl.

    Raises
    ------
    InputError
        There is no such device, or fewer than processes.
    """
    is_cuda = device.startswith("cuda")
    if is_cuda and not torch.cuda.is_available():
        raise InputError("there is no GPU here that torch can use; leave --device out, or install the CUDA build of torch")
    n = int(os.environ.get("WORLD_SIZE", "1"))
    if n == 1:
        return Processes()
    if is_cuda:
        mine, n_devices = int(os.environ.get("LOCAL_RANK", "0")), torch.cuda.device_count()
        if mine >= n_devices:
            raise InputError(f"torchrun started process {mine + 1} here, and there are {n_devices} GPUs; each process takes one")
        torch.cuda.set_device(mine)
    if not dist.is_initialized():
        dist.init_process_group("cpu:gloo,cuda:nccl" if is_cuda else "gloo")
    return Processes(dist.get_rank(), n)


def leave_processes() -> None:
    """Part from the others, once all have come this far."""
    if dist.is_initialized():
        dist.barrier()
        dist.destroy_process_group()
