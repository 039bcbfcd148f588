"""Where and how to compute: the device, and half precision where this machine is faster with it."""

from __future__ import annotations

import time
from contextlib import AbstractContextManager, nullcontext
from functools import cache

import torch


@cache
def device() -> torch.device:
    """The graphics card if there is one."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


@cache
def half_pays() -> bool:
    """Whether matrix products in bfloat16 are at least 1.5 times as fast as in float32 here; takes 0.1 s."""
    if device().type == "cuda":
        return torch.cuda.is_bf16_supported()
    _seconds(torch.float32)  # wakes the threads
    return _seconds(torch.float32) > 1.5 * _seconds(torch.bfloat16)


def _seconds(dtype: torch.dtype) -> float:
    a = torch.ones(640, 512, dtype=dtype)
    b = torch.ones(512, 1024, dtype=dtype)
    times = []
    for _ in range(20):  # the best of many: other programs may be running
        start = time.perf_counter()
        a @ b
        times.append(time.perf_counter() - start)
    return min(times)


def autocast() -> AbstractContextManager[object]:
    """Compute in bfloat16 where it pays; weights and sums that need it stay in float32."""
    if half_pays():
        return torch.autocast(device().type, torch.bfloat16)
    return nullcontext()
