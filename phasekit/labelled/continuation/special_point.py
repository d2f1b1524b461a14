"""`SpecialPoint`: where something happens on a branch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Generic

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array, Complex
from phasekit.bifurcation.special_points import KINDS
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.branch_points import announced
from phasekit.labelled.continuation.certified import enclosure_of
from phasekit.labelled.continuation.onward import Of, onward
from phasekit.labels.equality import same_fields
from phasekit.numerics.interrupts import keeps
from phasekit.numerics.waits import notice
from phasekit.spellings import Guided
from phasekit.systems.field_arrays import fields_of

#: Fields that follow from others: machine code from the problem, a point's branch from its branch.
NOT_COMPARED = ("field", "clock", "branch")


@dataclass(frozen=True, eq=False, repr=False)
class SpecialPoint(Guided, Generic[Of]):
    """A special point of a branch, such as a fold or a Hopf point.

    Of a map the kinds are fold, branch_point, period_doubling (PD) and torus (TR).

    Attributes
    ----------
    kind : str
        fold, branch_point, pitchfork, transcritical, hopf, neutral_saddle, cusp,
        bogdanov_takens, generalized_hopf, zero_hopf, hopf_hopf, event or end.
    label : str
        LP, BP (also pitchfork and transcritical), H, NS, CP, BT, GH, ZH, HH, UZ or EP.
    name : str
        Of an event its name; else empty.
    x : ndarray
        The state.
    parameters : mapping of str to float
        All parameters there.
    interval : tuple of float
        The values of the (first) free parameter at the two points of the branch between which it
        was found; a fold may lie beside it by the square of the step.
    residual : float
        Largest residual of the equations that define it, in the units of f.
    status : {"converged", "guess"}
        Whether these equations were solved to rounding. A guess is a point of the branch.
    message : str
        Why it is a guess, or why the branch ends.
    normal_form : mapping of str to float
        Coefficients on the center manifold, p the parameter, critical eigenvector of unit length:
        fold ``xi' = b (p - p0) + a xi^2``; transcritical ``xi' = d (p - p0) xi + a xi^2``;
        pitchfork ``xi' = d (p - p0) xi + c xi^3`` (supercritical: c < 0); Hopf: ``l1``, the first
        Lyapunov coefficient (divided by 2 omega once, see Notes), ``omega`` and ``d``, the speed
        at which the real part grows with the parameter. A coefficient that is not known is NaN,
        and `message` says why. Of maps: period doubling ``xi -> -xi + c xi^3`` (c > 0: the orbit
        of period 2 is stable), torus ``|xi| -> |xi| + d |xi|^3`` (d < 0: supercritical) and
        ``angle``, that of the multipliers. Those of points of codimension two stand in the
        guide, on the page of continuation; of cycles there are none.
    eigenvalues : ndarray
        Eigenvalues of f_x; of a map its multipliers.
    corank : int
        Dimension of the null space of f_x: 1 at folds and simple branch points, more at multiple
        branch points, 0 at Hopf points and ends.
    certified : bool
        Where proofs were asked for: whether exactly one point of its kind is proved to be within
        `enclosure`; of ends, whether the branch is proved to be there.
    enclosure : mapping of str to (float, float)
        Bounds of states and parameter, of a Hopf point of omega, of a neutral saddle of sigma (the
        eigenvalues are sigma and -sigma), of a torus point of sine and cosine of the angle; empty
        where nothing is proved.
    doubt : str
        What of it is not proved, and why.
    directions : ndarray, shape (branch, unknown)
        At a branch point the unit tangents (on scaled axes, unscaled; states, then the parameter)
        of the other branches through it, which `switch` follows: all real solutions of the reduced
        equations (see Notes).

    Notes
    -----
    ``l1 = Re[<p, C(q, q, q*)> - 2 <p, B(q, A^-1 B(q, q*))> + <p, B(q*, (2 i omega - A)^-1
    B(q, q))>]/(2 omega)`` with ``<q, q> = <p, q> = 1`` ([Kuznetsov2004] (5.62)); negative:
    supercritical.

    At a branch point of corank k the equations are reduced to k equations on the k + 1 null vectors
    of f_u (Liapunov-Schmidt). Their quadratic terms decide the directions; where a symmetry leaves
    none of these on the null space of f_x, their cubic terms. At a multiple branch point `message`
    says where directions may be missing.

    Derivatives, up to the fifth order, are exact for formulas; those of functions are differences,
    and `message` says which coefficients are known to few digits or not at all.

    Examples
    --------
    >>> import phasekit as pk
    >>> swallow = pk.Problem("mu + l*x - x**3", state="x", parameters={"mu": 0.0, "l": -1.0})
    >>> branch = pk.continuation(swallow, "l", x0=[0.0], span=(-1, 1))
    >>> (crossing,) = branch.special("pitchfork")
    >>> crossing.status, round(crossing.normal_form["c"], 9)
    ('converged', -1.0)
    >>> side = crossing.switch()
    >>> float(abs(side.points.x**2 - side.points.l).max()) < 1e-9
    True
    >>> branch = pk.continuation(swallow.replace(l=1.0), "mu", x0=[-1.3], span=(-1, 1))
    >>> folds = branch.special("fold")[0].curve("l", (-1, 1))
    >>> [point.kind for point in folds.special_points]
    ['end', 'cusp', 'end']
    """

    kind: str
    x: Array
    parameters: Mapping[str, float]
    interval: tuple[float, float]
    residual: float
    status: str
    message: str
    normal_form: Mapping[str, float]
    eigenvalues: Complex
    index: int
    special: Any
    branch: Of

    _guides: ClassVar[tuple[str, ...]] = ("point",)

    @property
    def way(self) -> str:
        """What leads on from it (`lead`)."""
        return self.branch.way

    @property
    def corank(self) -> int:
        """Dimension of the null space of f_x."""
        corank: int = self.special.corank
        return corank

    @property
    def certified(self) -> bool:
        """Whether it is proved."""
        found = self._proof
        return found is not None and bool(found.certified)

    @property
    def enclosure(self) -> Mapping[str, tuple[float, float]]:
        """Bounds of states and parameter, where it is proved."""
        if self._proof is None:
            return MappingProxyType({})
        return enclosure_of(self.branch, self._rank)

    @property
    def doubt(self) -> str:
        """What of it is not proved, and why."""
        if self._proof is None:
            return "proofs were not asked for: pk.continuation(..., certify=True)"
        return str(self._proof.reason)

    @property
    def _rank(self) -> int:
        return next(i for i, one in enumerate(self.branch.special_points) if one is self)

    @property
    def _proof(self) -> Any:
        found = getattr(self.branch, "_certificate", None)
        return None if found is None else found.specials[self._rank]

    @property
    def directions(self) -> Array:
        """Unit tangents of the other branches through a branch point, one a row."""
        n = len(self.x) + 1
        others = [t[:n] for t in self.special.others if isinstance(t, np.ndarray) and len(t) >= n]
        return np.array(others).reshape(-1, n)

    @property
    def label(self) -> str:
        """LP, BP, H, NS, CP, BT, GH, ZH, HH, UZ or EP."""
        return KINDS[self.kind].label

    @property
    def name(self) -> str:
        """The name of an event; else empty."""
        name: str = self.special.name
        return name

    @property
    def sensitivity(self) -> Any:
        """Derivatives of the point by all other parameters of the problem.

        The point moves with them: along a fold's curve, say, which `curve` follows. They come of
        one linear solve with the equations that define the point (see Notes).

        Returns
        -------
        xarray.Dataset
            Over `parameter`, the others: ``d_free`` of the parameters of the branch (`free`),
            ``d_state`` (`state`), ``d_coefficient`` of those of the normal form (`coefficient`),
            of periodic orbits instead ``d_period``, and ``d_number`` of the period and the
            extremes and means of states (`number`); ``reason`` says why a column is NaN,
            ``coefficient_reason`` why a coefficient is, as all those of branch points are.
            Units are those of coordinates ``free_units``, ``state_units`` over
            ``parameter_units``; empty where the problem has none.

        Notes
        -----
        With G(u, q) = 0 the equations of the point ([Kuznetsov2004] chapter 10), u its unknowns,
        ``du/dq = -G_u^-1 G_q``. Where G_u is singular, as of points in a family in more parameters,
        and of branch points that a parameter destroys, there is no derivative, and none is given.
        Of events of periodic orbits the family and its neighbours give them. Derivatives of
        formulas are exact; those of coefficients and numbers of orbits, and the conditions of
        points of codimension two, are differences of fourth order along that line.

        Examples
        --------
        >>> import phasekit as pk
        >>> cusp = pk.Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 0.75})
        >>> fold = pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1)).special("LP")[0]
        >>> round(fold.sensitivity.d_free.sel(parameter="l").item(), 9)  # -x
        0.5
        """
        return onward(f"{self.way}.sensitivity")(self)

    def _elsewhere(self, name: str) -> str:
        """Where states, parameters and coefficients are."""
        if name in self.normal_form:
            return f'point.normal_form["{name}"]'
        known = (*self.branch.problem_state, *self.parameters)
        return f'point["{name}"]' if name in known else ""

    def __getitem__(self, name: str) -> Any:
        """A state, a field of states over its places, or a parameter by name."""
        fields = fields_of(self.branch.problem, self.x[None])
        if name in fields:
            return fields[name].isel(point=0)
        if not fields and name in self.branch.problem_state:
            return float(self.x[self.branch.problem_state.index(name)])
        return self.parameters[name]

    @call_checked
    @keeps
    def switch(self, kind: str | None = None, *, direction: Any = 0, options: Any = None) -> Of:
        """The other branch through a branch point, or what begins at a point.

        Of a Hopf point the periodic orbits; of a period doubling of a map the orbit of period 2,
        as fixed points of the map applied twice. Of points of codimension two of flows curves in
        both parameters: bogdanov_takens fold, hopf and homoclinic (a `ConnectionBranch`),
        generalized_hopf fold_of_cycles, zero_hopf fold, hopf and torus, hopf_hopf hopf (that of the
        other pair) and torus. Of those of cycles
        curves of cycles of twice the period: generalized_flip fold_of_cycles, resonance_2 and
        fold_flip torus. At resonance_4 two curves of folds of orbits of four times the period,
        where they fold, of maps as fixed points of the map applied four times. Elsewhere the error
        says what begins there and why it is not followed.

        Parameters
        ----------
        kind : str, optional
            At a point of codimension two the kind of the curve; by default the first of these that
            is not the one that the point was found on.
        direction : int or states, default 0
            Which one where there are several: a row of `directions`, at a branch point of fields
            with several null vectors also states, as `continuation` takes them, whose part along
            these leads on; or one of the families at a Hopf point of several pairs, of which
            ``stops[0].message`` of each tells how many there are; at a Hopf-Hopf point 1 is the
            torus curve of the other pair, at a resonance_4 the other curve.
        options : ContinuationOptions, optional
            Default: those of the branch.

        Returns
        -------
        Branch
            The other branch; from a Hopf point, and of a kind of periodic orbits, a `CycleBranch`.

        Raises
        ------
        ParameterError
            If nothing begins at the point that can be followed, which the message says, or the
            kind or direction is not known.
        ConvergenceError
            If no periodic orbit is found near a Hopf point, or which there are is not known.

        See Also
        --------
        continuation, diagram

        Examples
        --------
        >>> import phasekit as pk
        >>> triangle = pk.Problem(
        ...     ["l*x + x**2 - y**2 - x*(x**2 + y**2)", "l*y - 2*x*y - y*(x**2 + y**2)"],
        ...     state=("x", "y"), parameters={"l": -1.0},
        ... )
        >>> branch = pk.continuation(triangle, "l", x0=[0.0, 0.0], span=(-1.0, 1.0))
        >>> (point,) = branch.special("BP")
        >>> point.corank, len(point.directions)
        (2, 3)
        >>> brusselator = pk.Problem(
        ...     ["1 - (b + 1)*x + x**2*y", "b*x - x**2*y"], ("x", "y"), {"b": 1.5}
        ... )
        >>> rest = pk.continuation(brusselator, "b", x0=[1.0, 1.5], span=(1, 3))
        >>> cycles = rest.special("H")[0].switch()
        >>> cycles.kind, round(float(cycles.points.period[0]), 2)
        ('cycle', 6.28)
        >>> sides = [point.switch(direction=i) for i in range(3)]
        """
        found: Of = onward(f"{self.way}.switch")(self, direction, options, kind)
        return announced(found)

    @call_checked
    @keeps
    def curve(
        self, parameter: str | Sequence[str], span: Sequence[Any], *, options: Any = None
    ) -> Of:
        """The curve of such points in this branch's parameter and a second one.

        A second parameter destroys branch points, unless a symmetry keeps them: they form curves in
        three, of equilibria and of cycles. The third may be one that only unfolds them, such as a
        constant in f. Of boundary
        value problems folds form curves.

        Parameters
        ----------
        parameter : str, or at branch points two of these
            The second parameter, and the third.
        span : (float, float), or two of these
            Its range.
        options : ContinuationOptions, optional
            Default: those of the branch.

        Returns
        -------
        Branch
            Of the kind of the point (fold, hopf, branch_point, event; of maps period_doubling and
            torus, too), with cusps, Bogdanov-Takens and other points of codimension two as its
            special points.

        Raises
        ------
        ParameterError
            If points of this kind form no curve, the parameter is unknown or the span unusable.

        Examples
        --------
        >>> import phasekit as pk
        >>> cusp = pk.Problem("mu + l*x - x**3", state="x", parameters={"mu": -1.0, "l": 1.0})
        >>> fold = pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1)).special("LP")[0]
        >>> curve = fold.curve("l", (-1.0, 2.0))
        >>> [point.kind for point in curve.special_points]
        ['end', 'cusp', 'end']
        >>> half = {"half": "x - 1/2"}
        >>> branch = pk.continuation(cusp, "mu", x0=[-1.3], span=(-1, 1), events=half)
        >>> curve = branch.special("half")[0].curve("l", (-1.0, 2.0))
        >>> bool(abs(curve.points.mu + curve.points.l / 2 - 1 / 8).max() < 1e-14)
        True
        """
        several = isinstance(parameter, (list, tuple))
        names = " and ".join(map(str, parameter)) if several else parameter
        with notice(f"following {self.kind} points along {names}"):
            found: Of = onward(f"{self.way}.curve")(self, parameter, span, options)
        return announced(found)

    def __eq__(self, other: object) -> bool:
        """Whether it is the same point of an equal branch."""
        if type(self) is not type(other) or not isinstance(other, SpecialPoint):
            return NotImplemented
        return same_fields(self, other, NOT_COMPARED) and bool(self.branch == other.branch)

    def __hash__(self) -> int:
        """Hash of the kind and the place on the branch."""
        return hash((self.kind, self.name, self.index, self.branch))

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles hold their branch, of which they are the same point."""
        return _point_of, (self.branch, self._rank)

    def __repr__(self) -> str:
        """Write kind, place and how well it is known."""
        where = [f"{name}={self.parameters[name]:.10g}" for name in self.branch.free]
        states = () if self.branch.problem.blocks else self.branch.problem_state[:4]
        where += [f"{n}={v:.6g}" for n, v in zip(states, self.x, strict=False)]
        notes = [f"{name}={value:.6g}" for name, value in self.normal_form.items()]
        notes += [f"corank={self.corank}"] if self.corank > 1 else []
        notes += [self.status] if self.status != "converged" else []
        notes += [self.message] if self.message else []
        what = f"{self.kind} {self.name!r}" if self.name else self.kind
        text = f"{self.label} {what} at {', '.join(where)}"
        return f"<{text}{'; ' if notes else ''}{', '.join(notes)}>"


def fixed(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A copy that cannot be written to."""
    array = array.copy()
    array.flags.writeable = False
    return array


def _point_of(branch: Of, place: int) -> SpecialPoint[Of]:
    point: SpecialPoint[Of] = branch.special_points[place]
    return point
