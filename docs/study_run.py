"""How the gallery runs a study."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

_FOLDER = tempfile.mkdtemp()


def argv(gallery_conf: Any, script_vars: Any) -> list[str]:
    """Arguments of a study: where it writes its picture, which the gallery takes from its Axes."""
    return [str(Path(_FOLDER) / "picture.png")]
