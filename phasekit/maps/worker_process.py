"""What runs in a worker process: it loads what computes and stores tiles, then takes them.

Little is loaded with this module, so that `work` can say what is not to be loaded at all.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import multiprocessing
import os
import signal
import sys
import threading
import types
import warnings
from multiprocessing.connection import Connection
from typing import Any


def work(pipe: Connection) -> None:
    """Compute the tiles that come, and answer for each; the first answer says that it can begin.

    It ends with its parent, however that ends.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if "fork" in multiprocessing.get_all_start_methods():
        # Then locks, as those of codecs, have no names, which the system kept after a kill.
        multiprocessing.set_start_method("fork", force=True)
    parent = multiprocessing.parent_process()
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    # The process that started this one has said so already.
    warnings.filterwarnings("ignore", "no lasting place for compiled kernels", RuntimeWarning)
    # Tiles are plain arrays: labels, a third of the time to start, are loaded if they are needed.
    sys.modules.setdefault("xarray", Later("xarray"))
    # Loaded while the parent is not ready.
    import zarr  # noqa: F401

    import phasekit.numerics.forms  # noqa: F401
    from phasekit.errors import StoreError
    from phasekit.maps.tile import compute

    with contextlib.suppress(EOFError, OSError):
        pipe.send("")
        while True:
            tile = pipe.recv()
            try:
                compute(tile)
            except StoreError as error:
                pipe.send(str(error))
            else:
                pipe.send("")


class Later(types.ModuleType):
    """A module that is loaded when something of it is used first."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.__spec__ = importlib.util.find_spec(name)

    def __getattr__(self, name: str) -> Any:
        """Load it, and return what was asked for."""
        if sys.modules.get(self.__name__) is self:
            del sys.modules[self.__name__]
        module = importlib.import_module(self.__name__)
        self.__dict__.update(module.__dict__)
        return getattr(module, name)


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)
