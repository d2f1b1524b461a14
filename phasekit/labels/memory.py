"""How much memory a map takes, and whether the machine has it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from math import prod
from pathlib import Path

from phasekit.errors import ParameterError

#: Part of the available memory that one map may take: the caller needs some for its use.
SHARE = 0.8

#: Bytes that need no question.
ALWAYS = 1_000_000


def available_memory() -> int | None:
    """Return the bytes that a process may still take, or None where the system does not say."""
    known = [value for value in (_meminfo(), _cgroup()) if value is not None]
    if not known:
        try:
            known.append(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
        except (AttributeError, ValueError, OSError):  # Windows
            return None
    return min(known)


def _meminfo() -> int | None:
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except (OSError, ValueError):
        pass
    return None


def _cgroup() -> int | None:
    """Return what is left of a container's limit (cgroup v2)."""
    try:
        limit = Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii").strip()
        used = Path("/sys/fs/cgroup/memory.current").read_text(encoding="ascii").strip()
        return max(int(limit) - int(used), 0)
    except (OSError, ValueError):  # no such group, or "max"
        return None


def refuse_too_large(bytes_of: Mapping[str, int], sizes: Mapping[str, int]) -> None:
    """Refuse results that will not fit, before any work, with the way out.

    Parameters
    ----------
    bytes_of : mapping of str to int
        Bytes of each result by its name.
    sizes : mapping of str to int
        Sizes of the dims that they span, for the message.

    Raises
    ------
    ParameterError
    """
    needed = sum(bytes_of.values())
    available = None if needed <= ALWAYS else available_memory()
    if available is None or needed <= SHARE * available:
        return
    axes = " x ".join(f"{dim} {size}" for dim, size in sizes.items())
    largest = ", ".join(sorted(bytes_of, key=bytes_of.__getitem__, reverse=True)[:3])
    raise ParameterError(
        f"axes: got {axes} = {prod(sizes.values()):.3g} cells, {human(needed)} of results, wants "
        f"at most {human(int(SHARE * available))}, {SHARE:.0%} of the memory that is free; take "
        f"coarser axes, name fewer quantities in of= (largest: {largest}), or put a sweep "
        f"into a store (store='map.zarr'); chunked DataArrays as axes stay lazy"
    )


def human(size: int) -> str:
    """Write a number of bytes: 1.5 GB."""
    value = float(size)
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if value < 1000.0:
            return f"{value:.3g} {unit}"
        value /= 1000.0
    return f"{value:.3g} PB"
