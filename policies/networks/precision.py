"""The numbers in which a network computes: bf16 where the device multiplies it faster than fp32, else fp32."""

from copy import deepcopy
from functools import cache

import torch

from policies.networks.models import Net, channels_last


@cache
def has_fast_bf16() -> bool:
    """Whether the processor multiplies bf16 faster than fp32."""
    return bool(torch.cpu._is_avx512_bf16_supported() or torch.cpu._is_amx_tile_supported())


def has_native_bf16() -> bool:
    """Whether the GPU multiplies bf16 itself; an older one only imitates it, which is slower than fp32."""
    return bool(torch.cuda.is_bf16_supported(including_emulation=False))


def precision_of(device: str) -> torch.dtype:
    """Return the fastest of both kinds of numbers on a device, as torch names it."""
    is_fast = has_native_bf16() if torch.device(device).type == "cuda" else has_fast_bf16()
    return torch.bfloat16 if is_fast else torch.float32


def autocast(device: str, precision: torch.dtype) -> torch.autocast:
    """Return the context in which a network with weights in fp32 learns, or judges, in a precision."""
    return torch.autocast(torch.device(device).type, torch.bfloat16, enabled=precision == torch.bfloat16)


def to_act_in(network: Net, precision: torch.dtype) -> Net:
    """Return the network to act with: a copy in bf16, its convolutions laid out with the channels last; in fp32 itself."""
    return channels_last(deepcopy(network).to(precision)) if precision == torch.bfloat16 else network
