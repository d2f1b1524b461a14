"""A progress bar that counts cells."""

from __future__ import annotations

import warnings
from typing import Any

from phasekit.numerics.waits import watched

#: Seconds between two states of a progress bar in a log.
LOG_SECONDS = 30.0


class _NoBar:
    def __enter__(self) -> _NoBar:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def update(self, cells: int) -> None:
        pass


def progress_bar(cells: int, progress: bool | None, done: int = 0) -> Any:
    """Return a bar that counts cells, with their rate and the time left; quiet unless asked for.

    None shows it in a terminal and in notebooks alone, and if it takes longer than a second.
    """
    if progress is False:
        return _NoBar()
    # A log gets a line in a while.
    quick = watched()
    if progress is None and not quick:
        return _NoBar()
    return _tqdm()(
        total=cells,
        initial=done,
        unit="cell",
        unit_scale=True,
        delay=1.0 if progress is None else 0.0,
        mininterval=0.1 if quick else LOG_SECONDS,
        desc="phasekit",
    )


def _tqdm() -> Any:
    """Return the bar of notebooks in a notebook that can show it, else that of terminals."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that a notebook has no widgets
        from tqdm.auto import tqdm
    return tqdm
