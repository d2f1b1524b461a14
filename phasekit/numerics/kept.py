"""Machine code kept on disk, so that a process need not compile what another one did.

It lies beside the package, or in the user's own folder of caches. Where neither can be written, as
by another user or with a home that is read-only, a folder of temporary files takes it, which must
be the user's alone: what is found there is run. Without one, kernels are compiled in each process.

A file holds only for what it was made from: the sources of the kernel and of all that it calls, the
constants in them, this compiler, this kind of processor. What it was made from stands at its head
and is compared when it is read. Whatever is out of order while files are written or read stops no
one: the kernel is compiled.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import re
import stat
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from phasekit.errors import warn
from phasekit.numerics.compiler.source import stamp

#: Where machine code is kept, if that is set; the second name is that of older versions.
VARIABLES = "PHASEKIT_CACHE_DIR", "NUMBA_CACHE_DIR"
ELSEWHERE = f"set the environment variable {VARIABLES[0]} to a folder of your own"
#: Begins each file; another layout has another one.
_MAGIC = b"phasekit machine code 1\n"
#: The file that tells how long quick forms ran.
_SECONDS = "seconds.json"
_PACKAGE = Path(__file__).parents[1]
_told = False


def folders() -> Iterator[Path]:
    """Where machine code may be kept, the best place first."""
    for name in VARIABLES:
        if os.environ.get(name):
            yield Path(os.environ[name]) / "phasekit-kernels"
            return
    yield _PACKAGE / "__pycache__" / "kernels"
    home = _folder_of_user()
    if home is not None:
        yield home
    private = _private_folder()
    if private is not None:
        yield private


def inventory() -> list[tuple[Path, int, int]]:
    """Where machine code may be kept, the best first, with the number of files and their bytes."""
    found = []
    for folder in folders():
        try:
            sizes = [one.stat().st_size for one in folder.glob("*.kernel")]
        except OSError:
            sizes = []
        found.append((folder, len(sizes), sum(sizes)))
    return found


def _folder_of_user() -> Path | None:
    """The folder where this system keeps what programs of this user can make again."""
    try:
        if sys.platform == "win32":
            above = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
        elif sys.platform == "darwin":
            above = Path.home() / "Library" / "Caches"
        else:
            above = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:  # no home
        return None
    return above / "phasekit" / "kernels" if above.is_absolute() else None


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


def read(name: str, form: str) -> bytes | None:
    """The object file of a kernel for kinds of arguments, if it is kept and still holds."""
    for folder in folders():
        try:
            content = (folder / file_of(name, form)).read_bytes()
        except OSError:
            continue
        image = _checked(content)
        if image is not None:
            return image
    return None


def _checked(content: bytes) -> bytes | None:
    """What a file holds, unless it is damaged or was made from something else."""
    head, mark, rest = content.partition(_MAGIC)
    line, _, image = rest.partition(b"\n")
    try:
        made_from = json.loads(line)
        if head or not mark or made_from["image"] != hashlib.sha256(image).hexdigest():
            return None
        sources = all(_digest_of(path) == one for path, one in made_from["sources"].items())
        if sources and all(_holds(*one) for one in made_from["constants"]):
            return image
    except (ValueError, KeyError, TypeError):
        pass
    return None


def _holds(module: str, name: str, digest: str) -> bool:
    """Whether a constant is what it was."""
    from phasekit.numerics.compiler.module import constant_digest

    space = getattr(sys.modules.get(module), "__dict__", {})
    return name in space and constant_digest(space[name]) == digest


def write(
    name: str, form: str, image: bytes, sources: set[str], constants: Mapping[Any, str]
) -> None:
    """Keep an object file, with what it was made from."""
    made_from = {
        "image": hashlib.sha256(image).hexdigest(),
        "sources": {_relative(path): _digest_of(path) for path in sorted(sources)},
        "constants": [[*key, digest] for key, digest in sorted(constants.items())],
    }
    content = _MAGIC + json.dumps(made_from).encode() + b"\n" + image
    wrong: Any = "no folder can be written to"
    for folder in folders():
        try:
            folder.mkdir(parents=True, exist_ok=True)
            _replace(folder, file_of(name, form), content)
        except OSError as error:
            wrong = error
            continue
        if folder.parent == Path(tempfile.gettempdir()).resolve():
            _tell(f"compiled kernels are kept in {folder}, and lost with it")
        return
    _tell(f"each process compiles its kernels anew, which takes seconds ({wrong})")


def seconds_of() -> dict[str, float]:
    """How long processes that have ended ran quick forms, by the files of these."""
    for folder in folders():
        try:
            found = json.loads((folder / _SECONDS).read_bytes())
            known = {str(name): float(one) for name, one in found.items()}
        except (OSError, ValueError, TypeError, AttributeError, OverflowError):
            continue
        return {name: one for name, one in known.items() if one >= 0.0}
    return {}


def add_seconds(more: Mapping[str, float]) -> None:
    """Add to them, in the folder of these files; of two processes at once one may be lost."""
    whole = seconds_of()
    for name, seconds in more.items():
        whole[name] = whole.get(name, 0.0) + seconds
    for folder in folders():
        there = {path.name for path in folder.glob("*.kernel")}
        if there.isdisjoint(more):
            continue
        kept_here = {name: one for name, one in whole.items() if name in there}
        with contextlib.suppress(OSError):
            _replace(folder, _SECONDS, json.dumps(kept_here).encode())
            return


def _replace(folder: Path, name: str, content: bytes) -> None:
    """Write a file whole or not at all."""
    handle, temporary = tempfile.mkstemp(dir=folder, prefix=".")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(temporary, folder / name)
    except BaseException:
        os.unlink(temporary)
        raise


def drop_oldest(name: str, most: int) -> None:
    """Leave so many files of a name in each folder, those that were written last."""
    for folder in folders():
        with contextlib.suppress(OSError):
            written = sorted(
                (one.stat().st_mtime_ns, one) for one in folder.glob(f"{name}-*.kernel")
            )
            for _, old in written[: max(0, len(written) - most)]:
                old.unlink(missing_ok=True)


def _tell(what: str) -> None:
    global _told
    if not _told:
        _told = True
        text = f"no lasting place for compiled kernels: {what}; {ELSEWHERE}"
        warn(text, RuntimeWarning)


def _relative(path: str) -> str:
    """A path as another copy of the package has it."""
    try:
        return Path(path).resolve().relative_to(_PACKAGE).as_posix()
    except ValueError:
        return path


def _digest_of(path: str) -> str:
    """What tells a source file from another one; those of the package are named from its folder."""
    return _digest(path, stamp(str(_PACKAGE / path)))


@functools.lru_cache(maxsize=1024)
def _digest(path: str, written: tuple[int, int]) -> str:
    try:
        return hashlib.sha256((_PACKAGE / path).read_bytes()).hexdigest()[:32]
    except OSError:
        return "missing"


def file_of(name: str, form: str) -> str:
    """The file of a kernel for kinds of arguments."""
    key = hashlib.sha256(json.dumps([name, form, environment()]).encode()).hexdigest()
    return f"{re.sub('[^A-Za-z0-9.]', '_', name)[-60:]}-{key[:24]}.kernel"


@functools.cache
def environment() -> tuple[Any, ...]:
    """What machine code depends on besides the kernel: compiler, processor, Python and NumPy."""
    import llvmlite
    import numpy as np

    from phasekit.numerics.compiler import entry, machine

    ours = sorted((Path(__file__).parent / "compiler").glob("*.py"))
    compiler = [_digest_of(str(path)) for path in ours]
    python = (
        sys.implementation.cache_tag,
        entry.HEAD,
        entry.readable(),
        np.__version__.split(".")[0],
    )
    return compiler, llvmlite.__version__, machine.processor(), sys.platform, python
