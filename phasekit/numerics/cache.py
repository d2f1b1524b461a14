"""Where compiled kernels are kept, so that a process need not compile what another one did.

numba keeps them beside the package, or in the user's own folder of caches. Where it can write to
neither, as another user or with a home that is read-only, a folder of temporary files takes them,
which must be the user's alone: numba runs what it finds there. Without one, kernels are compiled
in each process. What is found out of order while kernels are kept or looked for stops no one.
"""

from __future__ import annotations

import os
import stat
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

_config: Any = numba.config
_told = False

ELSEWHERE = "set the environment variable NUMBA_CACHE_DIR to a folder of your own"


def kept(compiler: Callable[..., Any], function: Callable[..., Any]) -> Any:
    """Return what a compiler of numba makes of a function, kept on a disk where that can be.

    The compiler takes the function and the keyword `cache`.
    """
    try:
        return _forgiving(compiler(function, cache=True))
    except RuntimeError:  # numba has no place
        pass
    folder = _private_folder()
    if folder is not None:
        named = _config.CACHE_DIR
        _config.CACHE_DIR = str(folder)
        try:
            made = _forgiving(compiler(function, cache=True))
        except RuntimeError:  # no space, or no rights to write there
            pass
        else:
            _tell(f"compiled kernels are kept in {folder}, and lost with it")
            return made
        finally:
            _config.CACHE_DIR = named
    _tell("each process compiles its kernels anew, which takes some seconds each")
    return compiler(function, cache=False)


def _private_folder() -> Path | None:
    """Return a folder among temporary files, None where others could write to it."""
    try:
        above = Path(tempfile.gettempdir()).resolve()
        if not hasattr(os, "getuid"):  # Windows: temporary files are the user's own
            folder = above / "phasekit-kernels"
            folder.mkdir(exist_ok=True)
            return folder
        user = os.geteuid()
        folder = above / f"phasekit-kernels-{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()  # it may have been there: another user's, or a link
        private = stat.S_ISDIR(found.st_mode) and found.st_uid == user and not found.st_mode & 0o077
        return folder if private and all(_is_safe(one, user) for one in folder.parents) else None
    except OSError:
        return None


def _is_safe(folder: Path, user: int) -> bool:
    """Whether no other user, but root, can put another folder in the place of one in it."""
    found = folder.stat()
    if found.st_uid not in (0, user):
        return False
    return not found.st_mode & 0o022 or bool(found.st_mode & stat.S_ISVTX)


def _forgiving(dispatcher: Any) -> Any:
    """Let kernels be compiled though they cannot be kept, or what was kept cannot be read.

    numba lets errors of a disk that is full, or read-only by now, stop the call that compiles. By
    a name that it does not publish; without it, that stays so.
    """
    cache: Any = getattr(dispatcher, "_cache", None)
    save, load = (getattr(cache, f"{verb}_overload", None) for verb in ("save", "load"))
    if save is None or load is None:
        return dispatcher

    def saved(signature: Any, data: Any) -> None:
        try:
            save(signature, data)
        except Exception as error:
            _tell(f"compiled kernels cannot be kept: {error}")

    def loaded(signature: Any, target: Any) -> Any:
        try:
            return load(signature, target)
        except Exception as error:
            _tell(f"compiled kernels that were kept cannot be read: {error}")
            return None

    cache.save_overload, cache.load_overload = saved, loaded
    return dispatcher


def _tell(what: str) -> None:
    global _told
    if not _told:
        _told = True
        warnings.warn(
            f"numba has no place for its cache: {what}; {ELSEWHERE}", RuntimeWarning, stacklevel=4
        )
