"""`Branch`: a traced curve with its special points; immutable, exportable, resumable."""

from __future__ import annotations

import difflib
import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from os import PathLike
from types import MappingProxyType
from typing import Any, Self, cast

import numpy as np
import numpy.typing as npt
import xarray as xr

from phasekit.bifurcation.continuation.curve import Curve, Stop, Track
from phasekit.bifurcation.continuation.curve_walk import CurveWalk
from phasekit.bifurcation.continuation.gaps import narrow
from phasekit.bifurcation.continuation.kernels.defining import (
    BRANCH,
    EQUILIBRIUM,
    EVENT,
    FLIP,
    FOLD,
    HOPF,
    TORUS,
)
from phasekit.bifurcation.continuation.path import Path, Sample, join
from phasekit.bifurcation.continuation.placed import Placed
from phasekit.bifurcation.continuation.points.special import Special
from phasekit.bifurcation.continuation.specials import Specials, find, not_searched
from phasekit.bifurcation.continuation.stops import SEARCHED
from phasekit.bifurcation.continuation.walk import Walker, cut, go_on, goes_on
from phasekit.bifurcation.special_points import KINDS as SPECIAL
from phasekit.errors import ParameterError
from phasekit.labelled.continuation.branch_points import Table, points_of
from phasekit.labelled.continuation.checks import check_bounds, check_span
from phasekit.labelled.continuation.onward import onward
from phasekit.labelled.continuation.special_point import NOT_COMPARED, SpecialPoint, special_point
from phasekit.labelled.continuation.unfinished import announced
from phasekit.labelled.pictures import picture
from phasekit.labels.arguments import bad, unknown, whole
from phasekit.labels.equality import equal, same_fields
from phasekit.numerics.waits import notice
from phasekit.systems.problem import Problem

FloatArray = npt.NDArray[np.float64]
Record = Mapping[str, Any]

KINDS = {
    EQUILIBRIUM: "equilibrium", FOLD: "fold", HOPF: "hopf", BRANCH: "branch_point",
    FLIP: "period_doubling", TORUS: "torus", EVENT: "event",
}  # fmt: skip
NUMBERS = {name: number for number, name in KINDS.items()}


#: Usual words for kinds of special points, beside their names and labels.
_SYNONYMS = {
    "limit_point": "fold",
    "saddle_node": "fold",
    "turning_point": "fold",
    "andronov_hopf": "hopf",
    "flip": "period_doubling",
    "neimark_sacker": "torus",
    "bautin": "generalized_hopf",
    "double_hopf": "hopf_hopf",
    "fold_hopf": "zero_hopf",
}


def _check_kind(label: Any, events: list[str]) -> None:
    """Refuse what is no kind, label or event, with the name that was probably meant."""
    labels = {kind.label for kind in SPECIAL.values()}
    valid = {*SPECIAL, *labels, *events}
    if isinstance(label, str) and label in valid:
        return
    hint = ""
    if isinstance(label, str):
        plain = label.strip().lower().replace(" ", "_").replace("-", "_")
        stem = plain.removesuffix("s").removesuffix("_point")
        words = (plain, plain.removesuffix("s"), stem, label.upper())
        meant = [_SYNONYMS.get(word, word) for word in words]
        meant = [word for word in meant if word in valid]
        meant = meant or difflib.get_close_matches(plain, [*SPECIAL, *events], n=1)
        hint = f"did you mean {meant[0]!r}?" if meant else ""
    names = [f"{kind.name} ({kind.label})" for kind in SPECIAL.values()]
    raise bad("label", label, f"one of {', '.join([*names, *events])}", hint)


@dataclass(frozen=True, eq=False, repr=False)
class Branch:
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
        beside that of the terms that cancel in it), and what was recorded.
    special_points : tuple of SpecialPoint
        In order along the curve.
    stops : tuple of Stop
        Why the curve ends, at its first and at its last point: ``reason`` (bound, closed,
        max_points, stuck, not_finite, start, or what it was to ``stop`` at) and ``message``.
    messages : tuple of str
        What is not certain about the curve as a whole; empty where nothing is in doubt.
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
    >>> curve, problem = branch.known()
    >>> problem is cubic
    True
    >>> plt.close(branch.plot().figure)

    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     branch.save(f"{folder}/branch.nc")
    ...     loaded = pk.Branch.load(f"{folder}/branch.nc")
    >>> loaded.points.equals(branch.points)
    True
    """

    problem: Problem
    free: tuple[str, ...]
    problem_state: tuple[str, ...]
    curve: Curve
    start: Sample
    tracks: tuple[Track | None, Track | None]
    _table: Table
    special_points: tuple[SpecialPoint[Branch], ...]
    stops: tuple[Stop, Stop]
    kind: str
    record: Record
    messages: tuple[str, ...] = ()

    @functools.cached_property
    def _points(self) -> xr.Dataset:
        """The points, made when they are first asked for."""
        return self._table()

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
            parameter and state, ``special_name`` of events, ``special_residual``,
            ``special_status``, ``special_corank``, ``special_index`` (the point of the curve),
            ``special_interval`` on (``special_point``, ``end``).
        """
        ds = self.points
        dim = "special_point"
        text = np.dtypes.StringDType()
        specials = self.special_points

        def strings(values: list[str]) -> tuple[str, Any]:
            return dim, np.array(values, dtype=text)

        ds["special_kind"] = strings([s.kind for s in specials])
        ds["special_label"] = strings([s.label for s in specials])
        ds["special_status"] = strings([s.status for s in specials])
        ds["special_message"] = strings([s.message for s in specials])
        if any(s.name for s in specials):
            ds["special_name"] = strings([s.name for s in specials])
        for name in (*self.free, *self.problem_state):
            ds[f"special_{name}"] = (dim, np.array([s[name] for s in specials]))
        ds["special_residual"] = (dim, np.array([s.residual for s in specials]))
        ds["special_corank"] = (dim, np.array([s.corank for s in specials], dtype=np.int64))
        ds["special_index"] = (dim, np.array([s.index for s in specials], dtype=np.int64))
        ds["special_interval"] = (
            (dim, "end"),
            np.array([s.interval for s in specials]).reshape(-1, 2),
        )
        return ds

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
        events = [event.name for event in getattr(self.curve, "events", ())]
        _check_kind(label, events)
        return tuple(s for s in self.special_points if label in (s.label, s.kind, s.name))

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
        curve, _ = self.known()
        most = curve.options.max_points if points is None else points
        count = whole("points", most, "a whole number >= 1")
        wider = self._wider(span, bounds)
        widened = self._walker(**wider)
        if not any(goes_on(widened, track) for track in self.tracks):
            reasons = "; ".join(stop.message for stop in self.stops)
            raise ParameterError(
                f"extend: the branch ended for other reasons than max_points: {reasons}; where it "
                "met a bound, give a wider span= or bounds="
            )
        with notice(f"extending the branch along {self.parameter}"):
            return announced(self._longer(count, wider))

    def _wider(
        self, span: Sequence[float] | None, bounds: Mapping[str, Sequence[float]] | None
    ) -> dict[str, Any]:
        """Bounds of the curve that are replaced, checked."""
        curve, _ = self.known()
        names = self._bounded()
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

    def _bounded(self) -> list[str]:
        """What the bounds of the curve are bounds of."""
        return [*self.curve.field.states, *self.free]

    def _walker(self, **changes: Any) -> Walker:
        """How it is followed, with changes of what defines it."""
        return CurveWalk(self.curve.replace(**changes))

    def _longer(self, count: int, bounds: Mapping[str, Any]) -> Self:
        curve, problem = self.known()
        curve = curve.replace(**bounds)
        backward, forward = go_on(CurveWalk(curve), self.start, self.tracks, count)
        made = make_branch(problem, curve, self.start, backward, forward, self.record)
        return cast(Self, made)

    def _discrete(self) -> bool:
        return self.problem.map

    def known(self) -> tuple[Curve, Problem]:
        """The curve and the problem.

        Returns
        -------
        tuple of (Curve, Problem)
        """
        return self.curve, self.problem

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
            The functions that were recorded, needed to extend a branch that has some.
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
        curve, problem = self.known()
        kept = {f.name: getattr(curve, f.name) for f in fields(curve) if f.name != "field"}
        return _again, (problem, kept, self.start, self.tracks, dict(self.record))

    def __eq__(self, other: object) -> bool:
        """Whether it is the same curve of an equal problem, traced and recorded alike."""
        if type(self) is not type(other):
            return NotImplemented
        same: bool = same_fields(self, other, (*NOT_COMPARED, "_table"))
        return same and equal(self._points, other._points)

    def __hash__(self) -> int:
        """Hash of what is followed, and how far."""
        return hash((type(self).__name__, self.kind, self.free, self._points.sizes["point"]))

    def __repr__(self) -> str:
        """Write what it is, its range, its special points and why it ends."""
        u = {name: self._points[name].values for name in self.free}
        ranges = ", ".join(f"{n} from {v.min():.6g} to {v.max():.6g}" for n, v in u.items())
        of = {"equilibrium": "fixed points" if self._discrete() else "equilibria"}.get(
            self.kind, f"{self.kind} points"
        )
        held = getattr(self.curve, "held", None)
        of = of if held is None else f"points of the event {held.name!r}"
        lines = [f"<Branch of {of}: {self._points.sizes['point']} points, {ranges}"]
        shown = [s for s in self.special_points if s.kind != "end"]
        lines += [f"  {special!r}" for special in shown[:20]]
        lines += [f"  ... {len(shown) - 20} more"] if len(shown) > 20 else []
        if self.closed:
            lines.append(f"  closed: {self.stops[1].message}")
        else:
            lines += [
                f"  {name}: {stop.message}"
                for name, stop in zip(("first", "last"), self.stops, strict=True)
            ]
        lines += [f"  not certain: {message}" for message in self.messages]
        return "\n".join(lines) + ">"


def make_branch(
    problem: Problem,
    curve: Curve,
    start: Sample,
    backward: Track | None,
    forward: Track | None,
    record: Record,
) -> Branch:
    """A branch of what was traced: special points are looked for, quantities recorded."""
    try:
        path = join(curve, start, backward, forward)
        found, gaps = find(curve, path), narrow(curve, path)
        return _branch_of(problem, curve, start, (backward, forward), path, found, gaps, record)
    except KeyboardInterrupt:  # what was followed is kept
        backward, forward = (
            None if track is None else replace(track, stop=SEARCHED)
            for track in (backward, forward)
        )
        path = join(curve, start, backward, forward)
        found, gaps = not_searched(path, curve.n), ()
        return _branch_of(problem, curve, start, (backward, forward), path, found, gaps, record)


def _branch_of(
    problem: Problem,
    curve: Curve,
    start: Sample,
    tracks: tuple[Track | None, Track | None],
    path: Path,
    found: Specials,
    gaps: tuple[str, ...],
    record: Record,
) -> Branch:
    """A branch of a path and the special points that were found on it."""
    found_at, eigenvalues, doubts = found
    path = replace(path, eigenvalues=eigenvalues)
    path, placed = cut(CurveWalk(curve), start, path, found_at)
    names = tuple(curve.field.parameters[i] for i in curve.active)
    specials = [*placed, *_ends(curve, path)]
    specials.sort(key=lambda one: (one.index, one.along))
    table, places, values = points_of(problem, curve, path, specials, record)
    branch = Branch(
        problem, names, curve.field.states, curve, start, tracks, table, (),
        path.stops, KINDS[curve.kind], MappingProxyType(dict(record)),
        (*path.messages, *doubts, *gaps),
    )  # fmt: skip
    made = tuple(
        special_point(problem, curve, one.special, own, place, branch)
        for one, own, place in zip(specials, values, places, strict=True)
    )
    object.__setattr__(branch, "special_points", made)
    return branch


def _again(
    problem: Problem,
    curve: Mapping[str, Any],
    start: Sample,
    tracks: tuple[Track | None, Track | None],
    record: Record,
) -> Branch:
    return make_branch(problem, Curve(problem.field, **curve), start, *tracks, record)


def _ends(curve: Curve, path: Path) -> list[Placed]:
    if path.closed:
        return []
    found = []
    for i, along, stop in ((0, -np.inf, path.stops[0]), (path.count - 1, np.inf, path.stops[1])):
        there = path.ends[0 if along < 0.0 else 1]
        u = path.u[i, : curve.m] if there is None else there.special.u
        at = float(u[curve.n])
        residual = float(np.max(np.abs(curve.at(u)[0])))
        special = Special(
            "end", u, (at, at), residual, "converged", stop.message, tangent=path.tangent[i]
        )
        found.append(Placed(i, along, special))
    return found
