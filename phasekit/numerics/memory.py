"""Memory that a process may still take: what would need more is refused before any is taken."""

from __future__ import annotations

import os
from pathlib import Path

from phasekit.errors import ParameterError

#: Part of the available memory that one result may take: the caller needs some for its use.
SHARE = 0.8

#: Bytes that need no question.
ALWAYS = 1_000_000


class Shortage(ParameterError):
    """What was asked for takes more memory than there is."""


#: What ends a walk, which keeps the points that it has.
HALTS = (KeyboardInterrupt, Shortage, MemoryError)


def why_halted(halt: BaseException) -> str:
    """Why a walk ends that was going on, in words that a place follows."""
    if isinstance(halt, KeyboardInterrupt):
        return "it was interrupted"
    return f"memory was short ({halt or 'a MemoryError'}): it was interrupted"


def room_short_of(needed: int) -> int | None:
    """Bytes that may be taken, where so many are needed that they do not fit; else None."""
    available = available_memory() if needed > ALWAYS else None
    return None if available is None or needed <= SHARE * available else int(SHARE * available)


def refuse(argument: str, got: object, wants: str, what: str, needed: int, instead: str) -> None:
    """Refuse an argument for which there is not the memory.

    Raises
    ------
    ParameterError
    """
    room = room_short_of(int(needed))
    if room is not None:
        raise Shortage(
            f"{argument}: got {got}, wants {wants}: {what} would take {human(int(needed))}, "
            f"{human(room)} are free; {instead}"
        )


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


def human(size: int) -> str:
    """Write a number of bytes: 1.5 GB."""
    value = float(size)
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if value < 1000.0:
            return f"{value:.3g} {unit}"
        value /= 1000.0
    return f"{value:.3g} PB"
