"""Files and folders that are written in one go: made beside their place, then put there.

A file takes the place of another in one step. No system but one exchanges folders so, therefore the
old one steps aside first and comes back if the new one does not get there. After a kill between the
two steps nothing has the name: whoever asks for it next puts the old one back.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from phasekit.errors import StoreError
from phasekit.numerics.interrupts import deferred_interrupts

#: What the old folder is called while it is aside.
_OLD = "replaced"

#: Seconds after which what is left over has no writer any more, where no lock can tell.
_LONG = 86_400.0


@contextlib.contextmanager
def scratch(target: Path) -> Iterator[Path]:
    """Give a folder beside a target, in which what will stand there is made, and remove it."""
    folder = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        with _locked(folder, wait=True):
            yield folder
    finally:
        if _spare(folder, target):
            shutil.rmtree(folder, ignore_errors=True)


def put(fresh: Path, target: Path) -> None:
    """Put what was made in a scratch folder into its place; if that fails, the old one stays."""
    with deferred_interrupts():
        if target.is_dir():
            old = fresh.parent / _OLD
            target.rename(old)
            try:
                fresh.replace(target)
            except BaseException:
                if not os.path.lexists(target):
                    old.rename(target)
                raise
        else:
            fresh.replace(target)


def put_back(target: Path, argument: str) -> None:
    """Put back what stepped aside for another that did not come, if nothing has the name."""
    if os.path.lexists(target):
        return
    aside = [folder for folder in _left(target) if (folder / _OLD / "zarr.json").is_file()]
    if not aside:
        return
    folder = max(aside, key=lambda one: one.stat().st_mtime)
    with _locked(folder, wait=True):
        try:
            if not os.path.lexists(target):
                (folder / _OLD).rename(target)
        except OSError as error:
            if not os.path.lexists(target):  # nor did another process put it back
                raise StoreError(
                    f"{argument}: {target} was being replaced when that was interrupted; what was "
                    f"there is now {folder / _OLD} and cannot be put back: {error}; rename it"
                ) from error
    sweep(target)


def sweep(target: Path) -> None:
    """Remove what writers that were killed left beside a target."""
    for folder in _left(target):
        with contextlib.suppress(OSError), _locked(folder, wait=False) as held:
            if held or time.time() - folder.stat().st_mtime > _LONG:
                own = {entry.name for entry in folder.iterdir()} <= {target.name, _OLD}
                if own and _spare(folder, target):
                    shutil.rmtree(folder, ignore_errors=True)


def _spare(folder: Path, target: Path) -> bool:
    """Whether a scratch folder does not hold what stood in a place that is empty now."""
    return os.path.lexists(target) or not os.path.lexists(folder / _OLD)


def _left(target: Path) -> list[Path]:
    """Return the scratch folders of a target."""
    ours = re.compile(re.escape(f".{target.name}.") + "[a-z0-9_]{8}")
    with contextlib.suppress(OSError), os.scandir(target.parent) as entries:
        return [
            Path(entry.path)
            for entry in entries
            if ours.fullmatch(entry.name) and entry.is_dir(follow_symlinks=False)
        ]
    return []


@contextlib.contextmanager
def _locked(folder: Path, *, wait: bool) -> Iterator[bool]:
    """Keep others from a folder, as long as this process lives; False where that is not known."""
    try:
        import fcntl

        handle = os.open(folder, os.O_RDONLY)
    except (ImportError, OSError):  # Windows has no locks on folders
        yield False
        return
    held = False
    try:
        with contextlib.suppress(OSError):  # another has it, or a file system without locks
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
            held = True
        yield held
    finally:
        os.close(handle)
