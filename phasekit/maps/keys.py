"""Names in stored documents that become paths: which of them a map may have.

Whoever made a map wrote them, so nothing of a file is read, written or removed under a name before
it is known to be one of the map's own. They are looked at as texts, for every system at once: what
is a file here may be a device, another file or a place elsewhere on the next one.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Set

#: The group that holds the plan, and the marks of tiles that are done.
GROUP = "sweep"
#: The document of a group or an array, and that of the store.
DOCUMENT = "zarr.json"
#: The document with the checksums of what was written in one go.
SEAL = f"phasekit/{DOCUMENT}"
#: The document with all that opening a finished map takes.
PACKED = f"{GROUP}/packed/{DOCUMENT}"

_PART = re.compile(r"part(0|[1-9][0-9]{0,8})")
#: Files that describe an array, or hold a coordinate in one piece.
_OF_ARRAY = re.compile(r"zarr\.json|c(/0)*")
#: What cannot be in a name on some system, and what Windows takes for a device.
_BAD = re.compile(r'[\x00-\x1f\x7f<>:"/\\|?*]')
_DEVICES = re.compile(r"con|prn|aux|nul|clock\$|conin\$|conout\$|(com|lpt)[0-9¹²³]", re.IGNORECASE)
#: Bytes of a name, to which zarr adds some while it writes.
_LONGEST = 200


def is_name(name: object) -> bool:
    """Whether an array may have a name: one that is a folder, and the same one, on every system."""
    if type(name) is not str or _BAD.search(name) or name != name.strip() or name.endswith("."):
        return False
    try:
        size = len(name.encode())
    except UnicodeEncodeError:  # half of a pair of surrogates
        return False
    return (
        0 < size <= _LONGEST
        and _folded(name) not in (GROUP, DOCUMENT)
        and _DEVICES.fullmatch(name.split(".")[0].rstrip()) is None
    )


def is_part(name: object) -> bool:
    """Whether a part may have a name."""
    return type(name) is str and _PART.fullmatch(name) is not None


def is_document(key: object, names: Set[str]) -> bool:
    """Whether a key is that of a document of the store, of a part, or of an array of these names.

    The chunk of a coordinate is one as well: the plan records both.
    """
    if type(key) is not str:
        return False
    name, _, file = key.partition("/")
    if name == GROUP:
        part, _, file = file.partition("/")
        return is_part(part) and file == DOCUMENT
    return key == DOCUMENT or (
        name in names and is_name(name) and _OF_ARRAY.fullmatch(file) is not None
    )


def unfit(names: Iterable[object]) -> list[str]:
    """Return the names that no arrays of a map may have, or not together: equal but for case."""
    every = list(dict.fromkeys(names))
    count = Counter(_folded(name) for name in every if type(name) is str)
    return [repr(n) for n in every if type(n) is not str or not is_name(n) or count[_folded(n)] > 1]


def _folded(name: str) -> str:
    """Return what is the same of names that some system takes for one."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())
