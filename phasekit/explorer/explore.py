"""`explore`: the page of a system, to look at in a notebook, to save, to open."""

from __future__ import annotations

import functools
import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from phasekit.errors import StoreError
from phasekit.explorer.equations import equations_as_script
from phasekit.explorer.explored import explored_facts
from phasekit.explorer.facts import facts_of
from phasekit.explorer.law import law_of
from phasekit.explorer.page import EQUATIONS, page
from phasekit.labels.arguments import bad, call_checked
from phasekit.laws.ladder import Conservative, Law, Routhian
from phasekit.spellings import Guided
from phasekit.systems.problem import as_problem
from phasekit.systems.system import as_system, single

#: Height of the page in a notebook, in pixels of the screen.
HEIGHT = 900


@call_checked
def explore(
    system: Any,
    *,
    over: Any = None,
    ranges: Mapping[str, Sequence[float]] | None = None,
    window: Mapping[str, Sequence[float]] | None = None,
    plane: Sequence[str] | None = None,
    duration: float | None = None,
) -> Explorer:
    """Build an interactive page of a system.

    Of a system in a potential: phase portrait, potential well, bifurcation diagram and parameter
    map with the fold curve. Of any other equations: phase portrait with field, nullclines,
    equilibria, manifolds of saddles and limit cycles, or a projection of more than two states;
    motions in time; a diagram of where motions end up over a parameter; curves of bifurcations over
    two parameters. There is a slider for every parameter. A click in the portrait starts a motion,
    a click in a map moves the system there. The page is one static file that works without a server
    and asks for nothing from outside.

    Parameters
    ----------
    system : system
        Its parameters are scalars. Equations are formulas; forced ones have a period.
    over : (str, str) or sequence of such pairs, optional
        Of equations: the two parameters over which curves of bifurcations of equilibria are
        computed, or several pairs. The first two by default, none if there is one parameter or the
        system is forced; ``()`` for none.
    ranges : mapping of str to (float, float), optional
        Of equations: ranges of sliders, by parameter. By default they reach from minus the value
        to four times that.
    window : mapping of str to (float, float), optional
        Of equations: what the portrait shows, and where equilibria and cycles are looked for, by
        state; by default the system's own window.
    plane : (str, str), optional
        Of equations of more than two states: those that are drawn at first; they can be chosen in
        the page.
    duration : float, optional
        Of equations: the time, or the number of iterations, for which motions are shown at first.

    Returns
    -------
    Explorer
        Shows itself in a notebook; ``.html`` is the page, ``.save(path)`` writes it to a file.

    Raises
    ------
    ParameterError
        If it is no system, a parameter is an array, its equations are functions of Python or hold a
        function that pages have not, a state has no window, or an argument does not belong to it.

    Notes
    -----
    The formulas of the page are printed from the law that phasekit computes with. The page computes
    in doubles by itself. Of systems in a potential, equilibria, turning points, periods and areas
    agree with phasekit to 1e-9 where the parameters decide them; next to folds and separatrices the
    library has more digits. Of equations, equilibria, their eigenvalues and the periods and
    multipliers of limit cycles agree to 1e-7; motions are drawn with a tolerance of 1e-8. A page
    proves nothing: equilibria and cycles are looked for, and may be missed. The curves over two
    parameters are followed by `diagram` and the points' ``curve`` when the page is built.

    Examples
    --------
    >>> import phasekit as pk
    >>> page = pk.explore(pk.Pendulum(length=0.5))
    >>> page
    Explorer of Pendulum(length=0.5, g=9.80665); .save("page.html") writes it, ... kB
    >>> page.html.startswith("<!doctype html>")
    True
    >>> neuron = pk.Problem(
    ...     {"v": "v - v^3/3 - w + I", "w": "eps*(v + a - b*w)"},
    ...     parameters={"I": 0.5, "eps": 0.08, "a": 0.7, "b": 0.8},
    ...     window={"v": (-2.5, 2.5), "w": (-1, 2)},
    ... )
    >>> pk.explore(neuron, over=("I", "b"), ranges={"I": (0, 2)})
    Explorer of Problem(v' = I - v**3/3 + v - w, ...); .save("page.html") writes it, ... kB
    """
    found = as_system(system, rung=Law, what="the explorer")
    if found.standing.traits is None and issubclass(found.rung, Conservative):
        given = {
            "over": over, "ranges": ranges, "window": window, "plane": plane, "duration": duration
        }  # fmt: skip
        for name, value in given.items():
            if value is not None:
                raise bad(name, value, "nothing for a system in a potential")
        _, parameters = single(found)
        found.law.check_searchable()  # type: ignore[attr-defined, unused-ignore]
        return Explorer(found, page(facts_of(found, parameters), law_of(found)))
    if found.standing.traits is None and not issubclass(found.rung, Routhian):
        single(found)
    problem = as_problem(found)
    if problem.system is not None:  # what stands behind x' = -V'(x)
        return explore(
            problem.system, over=over, ranges=ranges, window=window, plane=plane, duration=duration
        )
    facts = explored_facts(
        found, problem, over=over, ranges=ranges, window=window, plane=plane, duration=duration
    )
    law = equations_as_script(problem)
    return Explorer(found, page(facts, law, EQUATIONS, "flow.html"))


@dataclass(frozen=True, repr=False)
class Explorer(Guided):
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

    _guides: ClassVar[tuple[str, ...]] = ("page",)

    system: Any
    html: str

    @functools.partial(call_checked, name="save")
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
