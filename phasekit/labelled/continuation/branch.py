"""`Branch`: a traced curve with its special points; immutable, exportable, resumable."""

from __future__ import annotations

import difflib
import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from os import PathLike
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np
import xarray as xr

from phasekit.bifurcation.continuation.curve import Stop
from phasekit.bifurcation.continuation.walk import (
    NO_START,
    Found,
    Tracks,
    Walker,
    go_on,
    goes_on,
    halted,
    run,
    search,
)
from phasekit.bifurcation.special_points import KINDS as SPECIAL
from phasekit.errors import ParameterError
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.branch_points import (
    announced,
    head_of,
    html_of,
    plain,
    points_of,
    special_table,
    text_of,
    with_special_points,
    wrap,
)
from phasekit.labelled.continuation.certified import certificate_of, columns_of, is_provable, note
from phasekit.labelled.continuation.checks import check_bounds, check_span
from phasekit.labelled.continuation.onward import onward
from phasekit.labelled.continuation.special_point import NOT_COMPARED, SpecialPoint, fixed
from phasekit.labelled.pictures import picture
from phasekit.labels.arguments import bad, unknown, whole
from phasekit.labels.equality import equal, same_fields
from phasekit.labels.tables import table_of
from phasekit.numerics.interrupts import hold, keeps, may_end
from phasekit.numerics.memory import HALTS
from phasekit.numerics.waits import notice
from phasekit.spellings import Guided, Listed, Made, deprecate, kind_meant, refused
from phasekit.systems.problem import Problem

if TYPE_CHECKING:
    import pandas as pd

Record = Mapping[str, Any]
#: A special point of a path, its place among the points, and the eigenvalues there.
Place = tuple[Any, int, Any]
B = TypeVar("B", bound="Branch")


def _check_kind(label: Any, events: list[str]) -> None:
    """Refuse what is no kind, label or event, with the name that was probably meant."""
    labels = {kind.label for kind in SPECIAL.values()}
    valid = {*SPECIAL, *labels, *events}
    if isinstance(label, str) and label in valid:
        return
    if isinstance(label, str):
        meant = kind_meant(label, valid)
        near = [meant] if meant else difflib.get_close_matches(label, [*SPECIAL, *events], n=1)
        if near:  # rather than the long list
            kind = SPECIAL.get(near[0])
            such = f"a label such as {kind.label}" if kind else "a label"
            wants = f"a kind of special points, {such}, or the name of an event"
            raise bad("label", label, wants, f"did you mean {near[0]!r}?")
    names = [f"{kind.name} ({kind.label})" for kind in SPECIAL.values()]
    raise bad("label", label, f"one of {', '.join([*names, *events])}")


@dataclass(frozen=True, eq=False, repr=False)
class Branch(Guided, metaclass=Made):
    """A curve of equilibria (or of folds, Hopf or branch points, events), with its special points.

    Made by `continuation`, `SpecialPoint.switch`, `SpecialPoint.curve` and `diagram`.

    Attributes
    ----------
    points : xarray.Dataset
        On the dim ``point``, in order along the curve: the free parameters and states by name,
        ``arclength`` (0 at the start, on scaled axes), ``n_unstable`` (number of eigenvalues with
        a positive real part, of a map of multipliers outside the unit circle) or, of a
        conservative problem, ``kind`` (`EquilibriumKind`),
        ``tangent`` on (``point``, ``unknown``), ``special`` (the label of a special point, or an
        empty string), ``step``, ``newton_steps``, ``residual`` (the largest size of an entry of f
        beside that of the terms that cancel in it), and what was recorded. Where proofs were asked
        for: ``certified`` (whether the point is proved to lie next to the branch),
        ``certified_error`` on (``point``, ``unknown``) (a bound of how far it is from it, across
        the chord), ``certified_onward`` (whether one branch is proved to go from the point to the
        next, with no other in the tube about it), ``certified_radius`` on (``point``, ``unknown``)
        (a bound of how far that is from the chord), ``certified_doubt`` (why it is not proved).
    special_points : tuple of SpecialPoint
        In order along the curve.
    stops : tuple of Stop
        Why the curve ends, at its first and at its last point: ``reason`` (bound, closed,
        max_points, stuck, not_finite, start, or what it was to ``stop`` at) and ``message``.
    messages : tuple of str
        What holds of the curve as a whole, such as that something is not certain; else empty.
    kind : str
        equilibrium, fold, hopf, branch_point or event; of maps period_doubling or torus, too.
    parameter : str
        The free parameter; ``free`` holds all of them.
    problem : Problem
        What was followed.

    Notes
    -----
    Points solve ``f(x, p) = 0``, those of curves the extended systems of their kind
    ([Govaerts2000] chapter 4), and are traced by pseudo-arclength ([AllgowerGeorg1990] chapter 6).

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import phasekit as pk
    >>> cubic = pk.Problem("mu + x - x**3", state="x", parameters={"mu": -1.0})
    >>> short = pk.ContinuationOptions(max_points=5, directions="forward")
    >>> branch = pk.continuation(cubic, "mu", x0=[-1.3], span=(-1, 1), options=short)
    >>> branch.special("fold"), branch.stops[1].reason
    ((), 'max_points')
    >>> branch = branch.extend(500)
    >>> [round(fold["mu"], 12) for fold in branch.special("LP")]
    [0.38490017946, -0.38490017946]
    >>> branch.to_dataset().special_kind.values.tolist()
    ['end', 'fold', 'fold', 'end']
    >>> branch.problem is cubic
    True
    >>> plt.close(branch.plot().figure)

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     branch.save(f"{folder}/branch.nc")
    ...     loaded = pk.Branch.load(f"{folder}/branch.nc")
    >>> loaded.points.equals(branch.points)
    True
    """

    _guides: ClassVar[tuple[str, ...]] = ("branch",)
    _point: ClassVar[type[SpecialPoint[Any]]] = SpecialPoint
    #: What leads on from its special points (`lead`).
    way: ClassVar[str] = "point"
    #: What follows from the rest, and is not compared.
    _derived: ClassVar[tuple[str, ...]] = ("_table",)
    _made_by: ClassVar[str] = "pk.continuation or .switch(); Branch.load opens one that was saved"

    problem: Problem
    walker: Walker
    start: Any
    tracks: Tracks
    origin: Stop
    record: Record
    stops: tuple[Stop, Stop]
    messages: tuple[str, ...]
    _table: Callable[[], xr.Dataset]
    _places: tuple[Place, ...]

    @staticmethod
    def _tabulated(
        problem: Problem, walker: Any, found: Found, record: Record
    ) -> tuple[Callable[[], xr.Dataset], list[Place]]:
        """What makes the points, and where special points stand among them."""
        return points_of(problem, walker.curve, found, record)

    @functools.cached_property
    def special_points(self) -> tuple[SpecialPoint[Self], ...]:
        """In order along the curve."""
        return tuple(self._special_point(*place) for place in self._places)

    def _special_point(self, found: Any, index: int, eigenvalues: Any) -> SpecialPoint[Self]:
        special = found.special
        x, parameters = self._values(special)
        return self._point(
            special.kind, fixed(x), MappingProxyType(parameters), special.interval,
            special.residual, special.status, special.message,
            MappingProxyType(dict(special.normal_form)), fixed(eigenvalues), index, special, self,
        )  # fmt: skip

    def _values(self, special: Any) -> tuple[Any, dict[str, float]]:
        """States and parameters of a special point, angles in one turn."""
        curve, n = self.walker.curve, self.walker.curve.n
        values = map(float, special.u[n : n + len(self.free)])
        x = special.u[:n].copy()
        for j in np.flatnonzero(curve.period[:n] > 0.0):
            x[j] = wrap(x[j], float(curve.period[j]))
        return x, dict(self.problem.parameters) | dict(zip(self.free, values, strict=True))

    @functools.cached_property
    def _points(self) -> xr.Dataset:
        """The points, made when they are first asked for."""
        ds = self._table()
        found = self._certificate
        if found is None:
            return ds
        proofs = columns_of(found)
        for _, array, _ in proofs.values():
            array.flags.writeable = False
        return ds.assign(proofs)

    @functools.cached_property
    def _certificate(self) -> Any:
        """What is proved of it, None unless that was asked for."""
        return certificate_of(self, self._table()) if is_provable(self) else None

    @property
    def certified(self) -> bool:
        """Whether all of it is proved: each stretch between points, and each special point."""
        found = self._certificate
        return found is not None and bool(
            found.stretches.all() and all(one.certified for one in found.specials)
        )

    @property
    def curve(self) -> Any:
        """The equations of what was followed."""
        return self.walker.curve

    @property
    def kind(self) -> str:
        """What it is a curve of."""
        return self.walker.kind

    @functools.cached_property
    def free(self) -> tuple[str, ...]:
        """The free parameters."""
        names = self.walker.curve.field.parameters
        return tuple(names[i] for i in self.walker.curve.active)

    @property
    def problem_state(self) -> tuple[str, ...]:
        """The states."""
        states: tuple[str, ...] = self.walker.curve.field.states
        return states

    @property
    def points(self) -> xr.Dataset:
        """The points as a Dataset; its values are read-only."""
        return self._points.copy()

    @property
    def parameter(self) -> str:
        """The (first) free parameter."""
        return self.free[0]

    @property
    def closed(self) -> bool:
        """Whether the curve ends on its start."""
        return self.stops[1].reason == "closed"

    def to_dataset(self) -> xr.Dataset:
        """The points, and the special points on the dim ``special_point``.

        Returns
        -------
        xarray.Dataset
            `points`, and ``special_kind``, ``special_label``, ``special_<name>`` of each free
            parameter and state (of fields an array over its places), ``special_name`` of events,
            ``special_residual``, ``special_status``, ``special_corank``, ``special_index`` (the
            point of the curve), ``special_interval`` on (``special_point``, ``end``), and
            ``special_period`` of periodic orbits.
        """
        return with_special_points(plain(self._points), self)

    def table(self) -> pd.DataFrame:
        """The special points, a row each, for reading.

        Returns
        -------
        pandas.DataFrame
            Label and kind, free parameters and states by name, and the name of an event or what is
            said of the point. ``residual`` and ``status`` where not all points are converged.

        Examples
        --------
        >>> import phasekit as pk
        >>> cusp = pk.Problem("mu + x - x**3", state="x", parameters={"mu": -1.0})
        >>> branch = pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1))
        >>> branch.table()[["kind", "mu"]].round(4).values.tolist()
        [['end', -1.0], ['fold', 0.3849], ['fold', -0.3849], ['end', 1.0]]
        """
        return special_table(self)

    def to_dataframe(self) -> pd.DataFrame:
        """The points of the curve, a row each.

        Returns
        -------
        pandas.DataFrame
            What `points` has at each point, codes by their names. What has more than one number
            there has as many columns: ``tangent v``, ``multiplier 1``, .... Arrays over space are
            left out.

        Examples
        --------
        >>> import phasekit as pk
        >>> cusp = pk.Problem("mu + x - x**3", state="x", parameters={"mu": -1.0})
        >>> branch = pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1))
        >>> len(branch.to_dataframe()) == branch.points.sizes["point"]
        True
        """
        return table_of(self.points, frozenset({"point"}))

    @functools.partial(call_checked, name="special")
    def special(self, label: str) -> tuple[SpecialPoint[Branch], ...]:
        """Special points of one kind (fold, ...), label (LP, BP, ...) or named event.

        Parameters
        ----------
        label : str
            A kind, a label, or the name of an event.

        Returns
        -------
        tuple of SpecialPoint
            In order along the curve; empty if there is none.

        Raises
        ------
        ParameterError
            If there is no such label, kind or event.
        """
        events = [event.name for event in self.walker.curve.events]
        _check_kind(label, events)
        found = (s for s in self.special_points if label in (s.label, s.kind, s.name))
        return Listed(found, f"special({label!r}) of <{head_of(self)}>")

    def plot(self, ax: Any = None, **keywords: Any) -> Any:
        """Draw the curve with its special points.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure if left out.
        **keywords
            What `phasekit.plot.branch` takes: ``x``, ``y``, ``units``, ...

        Returns
        -------
        matplotlib.axes.Axes
        """
        return picture("branch")(self, ax=ax, **keywords)

    @functools.partial(call_checked, name="extend")
    @keeps
    def extend(
        self,
        points: int | None = None,
        *,
        span: Sequence[float] | None = None,
        bounds: Mapping[str, Sequence[float]] | None = None,
    ) -> Self:
        """Continue a curve from its ends; a new branch.

        It goes on where the branch was cut: by ``max_points``, by Ctrl-C, at a ``stop``, or at a
        bound that is wider now. Its points are, bit for bit, those of a branch that was never cut.

        Parameters
        ----------
        points : int, optional
            How many more at most in each direction; default: the option max_points.
        span : (float, float), optional
            A wider range of the parameter, for a branch that met its end.
        bounds : mapping of str to (float, float), optional
            Wider bounds of states and parameters by name.

        Returns
        -------
        Branch
            The longer one; this one stays as it is.

        Raises
        ------
        ParameterError
            If no end can be extended, bounds are narrower than they were, or the problem is not
            known.

        Examples
        --------
        >>> import phasekit as pk
        >>> cusp = pk.Problem("mu + x - x**3", state="x", parameters={"mu": -1.0})
        >>> branch = pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1), stop="fold")
        >>> longer = branch.extend()
        >>> len(branch.special("fold")), len(longer.special("fold"))
        (1, 2)
        >>> round(float(longer.extend(span=(-1, 2)).points.mu.max()), 9)
        2.0
        """
        most = self.walker.options.max_points if points is None else points
        count = whole("points", most, "a whole number >= 1")
        walker = self.walker.over(**self._wider(span, bounds))
        if not any(goes_on(walker, track) for track in self.tracks):
            reasons = "; ".join(stop.message for stop in self.stops)
            raise ParameterError(
                f"extend: the branch ended for other reasons than max_points: {reasons}; where it "
                "met a bound, give a wider span= or bounds="
            )
        with notice(f"extending the branch along {self.parameter}"):
            tracks = go_on(walker, self.start, self.tracks, count)
            return announced(branch_of(
                type(self), self.problem, walker, self.start, self.record, tracks, self.origin,
            ))  # fmt: skip

    def _wider(
        self, span: Sequence[float] | None, bounds: Mapping[str, Sequence[float]] | None
    ) -> dict[str, Any]:
        """Bounds of the curve that are replaced, checked."""
        curve, names = self.walker.curve, self.walker.bounded
        asked = dict(check_bounds(bounds))
        if span is not None:
            if len(self.free) != 1:
                raise bad("span", span, f"None: give bounds= of {' and '.join(self.free)}")
            asked[self.parameter] = span
        low, high = curve.low.copy(), curve.high.copy()
        for name, pair in asked.items():
            if name not in names:
                raise unknown("bounds: state or parameter", name, names)
            argument = (
                "span" if span is not None and name == self.parameter else f"bounds[{name!r}]"
            )
            first, last = check_span(pair, None, argument)
            i = names.index(name)
            least, most = low[i], high[i]
            state = name in self.problem_state and curve.period[i] == 0.0
            if state and name not in curve.options.bounds:  # nobody gave these
                least, most = np.min(self._points[name]), np.max(self._points[name])
            if first > least or last < most:
                raise bad(argument, pair, f"a range that holds {least:.9g} to {most:.9g}")
            low[i], high[i] = first, last
        return {"low": low, "high": high}

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            """An older name, with a warning."""
            if name != "known":
                return refused(self, name)
            deprecate("Branch.known()", "(Branch.curve, Branch.problem)")
            return lambda: (self.walker.curve, self.problem)

    def _elsewhere(self, name: str) -> str:
        """Where the columns of its points, and special points of a kind are."""
        if name in self._points.variables:
            return f"branch.points.{name}"
        kind = kind_meant(name, SPECIAL)
        return f'branch.special("{kind}")' if kind else ""

    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Save everything, to be loaded and extended exactly.

        Parameters
        ----------
        path : path
            A name that ends in ``.zarr`` or ``.nc``.
        overwrite : bool, default False
            Whether a branch that is there already may be replaced.

        Raises
        ------
        ParameterError
            If the name ends otherwise, or the problem is not known.
        StoreError
            If there is something under that name.
        """
        onward("branch.save")(self, path, overwrite)

    @staticmethod
    def load(
        path: str | PathLike[str], *, problem: Any = None, record: Record | None = None,
        events: Mapping[str, Any] | None = None,
    ) -> Branch:  # fmt: skip
        """Load a saved branch.

        Parameters
        ----------
        path : path
            What `save` wrote.
        problem : Problem, optional
            Needed to go on where f is Python or compiled code, which is not saved.
        record : mapping, optional
            The functions that were recorded, or formulas in their place, of a branch that has some;
            formulas that were recorded are in the file.
        events : mapping, optional
            The functions among its events, which are not saved.

        Returns
        -------
        Branch
            Equal to what was saved; of periodic orbits a `CycleBranch`.

        Raises
        ------
        StoreError
            If nothing that `save` wrote is there, or it is damaged.
        """
        loaded: Branch = onward("branch.load")(path, problem, record, events)
        return loaded

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles are made again of what was traced, as when a branch is loaded."""
        curve = self.walker.curve
        kept = {f.name: getattr(curve, f.name) for f in fields(curve) if f.name not in NOT_COMPARED}
        return _again, (
            type(self), type(self.walker), type(curve), self.problem, kept, self.start,
            self.tracks, dict(self.record), self.origin,
        )  # fmt: skip

    @staticmethod
    def _code(problem: Problem, curve: Mapping[str, Any]) -> dict[str, Any]:
        """Machine code of a curve, which is not kept."""
        return {"field": problem.field}

    def __eq__(self, other: object) -> bool:
        """Whether it is the same curve of an equal problem, traced and recorded alike."""
        if type(self) is not type(other):
            return NotImplemented
        same: bool = same_fields(self, other, (*NOT_COMPARED, *self._derived))
        return same and equal(self._points, other._points)

    def __hash__(self) -> int:
        """Hash of what is followed, and how far."""
        return hash((type(self).__name__, self.kind, self.free, self._points.sizes["point"]))

    #: Numbers of a point, beside its free parameters, that it is shown with.
    @property
    def _numbers(self) -> tuple[str, ...]:
        return ()

    def _notes(self) -> list[str]:
        """What is to be said of it: why it ends, and what is not certain."""
        if self.closed:
            ends = [f"closed: {self.stops[1].message}"]
        else:
            ends = [
                f"{name}: {stop.reason}, {stop.message}"
                for name, stop in zip(("first", "last"), self.stops, strict=True)
            ]
        proofs = [] if self._certificate is None else [note(self)]
        return [*ends, *self.messages, *proofs]

    def __repr__(self) -> str:
        """Write what it is, its range, its special points and why it ends."""
        return text_of(self, self._notes())

    def _repr_html_(self) -> str:
        """Write the same for a notebook, special points in a table."""
        return html_of(self, self._notes())


def branch_of(
    form: type[B], problem: Problem, walker: Walker, start: Any, record: Record,
    tracks: Tracks | None = None, origin: Stop = NO_START,
) -> B:  # fmt: skip
    """What is followed from a start, or was: special points are found, quantities recorded."""
    if tracks is None:
        tracks = run(walker, start, walker.options.directions)
    hold()
    try:
        with may_end():
            found = search(walker, start, tracks, origin)
            branch = branch_of_found(form, problem, walker, start, tracks, record, found, origin)
            if record:  # functions of the user are called now
                _ = branch._points
            return branch
    except HALTS as halt:  # what was followed is kept
        tracks = halted(tracks, halt)
        found = search(walker, start, tracks, origin, interrupted=True)
        return branch_of_found(form, problem, walker, start, tracks, record, found, origin)


def branch_of_found(
    form: type[B], problem: Problem, walker: Walker, start: Any, tracks: Tracks, record: Record,
    found: Found, origin: Stop = NO_START,
) -> B:  # fmt: skip
    """A branch of what was followed and found on it."""
    table, places = form._tabulated(problem, walker, found, record)
    return form(
        problem, walker, start, tracks, origin, MappingProxyType(dict(record)),
        found.path.stops, found.messages, table, tuple(places),
    )  # fmt: skip


def _again(
    form: type[Branch], walker: Any, curve: Any, problem: Problem, kept: Mapping[str, Any],
    start: Any, tracks: Tracks, record: Record, origin: Stop,
) -> Branch:  # fmt: skip
    followed = walker(curve(**form._code(problem, kept), **kept))
    return branch_of(form, problem, followed, start, record, tracks, origin)
