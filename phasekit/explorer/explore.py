"""`explore`: the page of a system, to look at in a notebook, to save, to open."""

from __future__ import annotations

import html
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from phasekit.errors import StoreError
from phasekit.explorer.page import page
from phasekit.labels.arguments import bad
from phasekit.laws.ladder import Conservative
from phasekit.systems.system import as_system, single

#: Height of the page in a notebook, in pixels of the screen.
HEIGHT = 900


def explore(system: Any) -> Explorer:
    """Build an interactive page of a system.

    Phase portrait, potential well, bifurcation diagram and parameter map with the fold curve, with
    a slider for every parameter. A click in the portrait starts an orbit, a click in the map moves
    the system there. The page is one static file that works without a server and asks for nothing
    from outside.

    Parameters
    ----------
    system : system
        A trigonometric system or a `Potential`; its parameters are scalars.

    Returns
    -------
    Explorer
        Shows itself in a notebook; ``.html`` is the page, ``.save(path)`` writes it to a file.

    Raises
    ------
    ParameterError
        If it is no such system, a parameter is an array, or its potential holds a function that
        pages have not.

    Notes
    -----
    The formulas of the page are printed from the law that phasekit computes with. The page computes
    in doubles by itself: equilibria, turning points, periods and areas agree with phasekit to 1e-9
    where the parameters decide them; next to folds and separatrices the library has more digits.

    Examples
    --------
    >>> import phasekit as pk
    >>> page = pk.explore(pk.Pendulum(length=0.5))
    >>> page
    Explorer of Pendulum(length=0.5, g=9.80665); .save("page.html") writes it, ... kB
    >>> page.html.startswith("<!doctype html>")
    True
    """
    found = as_system(system, rung=Conservative, what="the explorer")
    _, parameters = single(found)
    found.law.check_searchable()  # type: ignore[attr-defined, unused-ignore]
    return Explorer(found, page(found, parameters))


@dataclass(frozen=True, repr=False)
class Explorer:
    """The page of a system; a notebook shows it.

    Attributes
    ----------
    system : system
        What it shows.
    html : str
        The page.

    Examples
    --------
    >>> import phasekit as pk
    >>> import tempfile, pathlib
    >>> page = pk.explore(pk.Pendulum(length=0.5))
    >>> path = page.save(pathlib.Path(tempfile.mkdtemp()) / "pendulum.html")
    >>> path.stat().st_size > 10_000
    True
    """

    system: Any
    html: str

    def save(self, path: str | Path) -> Path:
        """Write the page to a file.

        Parameters
        ----------
        path : str or path-like
            A name that ends in ``.html`` or ``.htm``. An existing file is replaced.

        Returns
        -------
        Path

        Raises
        ------
        ParameterError
            If the name is not that of a page.
        StoreError
            If the folder does not exist, or the file cannot be written.
        """
        try:
            target = Path(path)
        except TypeError:
            raise bad("path", path, "the name of a file that ends in .html") from None
        if target.suffix.lower() not in (".html", ".htm"):
            raise bad("path", path, "the name of a file that ends in .html")
        if not target.parent.is_dir():
            raise StoreError(f"path: the folder {target.parent} does not exist; make it first")
        try:
            target.write_text(self.html, encoding="utf-8")
        except OSError as error:
            raise StoreError(
                f"path: {target} cannot be written: {error.strerror or error}"
            ) from error
        return target

    def __repr__(self) -> str:
        """Say what it shows and what to do with it."""
        size = round(len(self.html.encode()) / 1000)
        return f'Explorer of {self.system!r}; .save("page.html") writes it, {size} kB'

    def _repr_html_(self) -> str:
        """Show the page in a frame of its own."""
        return (
            f'<iframe title="phasekit explorer" srcdoc="{html.escape(self.html)}" '
            f'style="width: 100%; height: {HEIGHT}px; border: 0" loading="lazy" '
            'allow="clipboard-write"></iframe>'
        )
