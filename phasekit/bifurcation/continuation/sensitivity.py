"""How special points of equilibria move with all other parameters.

At a point its defining system G(u, q) = 0 is square in its own unknowns u and regular. So
du/dq = -G_u^-1 G_q: the system of curves in two parameters, with all other parameters free at
once, gives both parts in one evaluation. Of points of codimension two G has one row more, the
derivatives of the function of the curve that vanishes there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.kernels import defining
from phasekit.bifurcation.continuation.points import fold, pair, period_doubling, torus
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.points.curve_tests import looked_for_on
from phasekit.bifurcation.continuation.points.regular import forms_beside
from phasekit.bifurcation.continuation.points.special import CONVERGED, Special, extended
from phasekit.bifurcation.continuation.units import force_sizes
from phasekit.bifurcation.special_points import KINDS

Form = Callable[[Derivatives, Array], Mapping[str, float]]

SINGULAR = 1e-10  # least singular value of a scaled system that is no rounding
STAYS = 1e-8  # part of its scale by which a branch point that a parameter keeps may be lost
STEPS = 25  # of Newton's method
STEP = 1e-3  # of the scales, in differences along a line
#: Weights of f(x - 2h), f(x - h), f(x + h), f(x + 2h) in h f'(x), to the fourth order.
STENCIL = ((-2.0, 1.0 / 12.0), (-1.0, -2.0 / 3.0), (1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0))


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of a special point by other parameters, one a column."""

    others: tuple[int, ...]  # places of these parameters
    x: Array  # shape (state, parameter)
    free: Array  # shape (free parameter, parameter)
    form: Mapping[str, Array]  # those of the coefficients of the normal form
    reasons: tuple[str, ...]  # why a column is not known; empty where it is
    period: Array | None = None  # that of the period of an orbit


def unknown(
    others: tuple[int, ...], states: int, free: int, form: Mapping[str, float], why: str
) -> Sensitivity:
    """Nothing is known."""
    k = len(others)
    lost = {name: np.full(k, np.nan) for name in form}
    return Sensitivity(
        others, np.full((states, k), np.nan), np.full((free, k), np.nan), lost, (why,) * k
    )


#: Defining systems by the name of the curve of a kind.
SYSTEMS = {
    "fold": defining.FOLD, "hopf": defining.HOPF, "branch_point": defining.BRANCH,
    "period_doubling": defining.FLIP, "torus": defining.TORUS, "event": defining.EVENT,
}  # fmt: skip


def sensitivity(curve: Curve, special: Special, *, coefficients: bool = True) -> Sensitivity:
    """How a special point of a branch, or of a curve in two parameters, moves.

    Without ``coefficients`` those of the normal form are left out but for the frequency.
    """
    free = len(curve.active)
    others = tuple(i for i in range(len(curve.par)) if i not in curve.active)
    if why := _hindered(curve, special):
        return unknown(others, curve.n, free, special.normal_form, why)
    if not others:
        return unknown(others, curve.n, free, special.normal_form, "")
    point = _Point(curve, special, others)
    with np.errstate(all="ignore"):
        return point.solved(coefficients=coefficients)


def moved(
    curve: Curve, special: Special, par: Array, by: Sensitivity, *, coefficients: bool
) -> tuple[Curve, Special] | None:
    """The point at other parameters, next to where its derivatives lead; None if there is none."""
    others = by.others
    change = par[list(others)] - curve.par[list(others)]
    here, n, m = curve.replace(par=par), curve.n, curve.m
    u = special.u.copy()
    u[:n] += np.nan_to_num(by.x) @ change
    u[n:m] += np.nan_to_num(by.free) @ change
    with np.errstate(all="ignore"):
        point = _Point(here, replace(special, u=u), others)
        if not point.refined():
            return None
        # Beyond a double zero the same equations are those of the other kind.
        if len(curve.active) == 1 and special.kind in ("hopf", "neutral_saddle"):
            if not (point.u[-1] > 0.0) == (special.kind == "hopf"):
                return None
        found = dict.fromkeys(special.normal_form, np.nan)
        if coefficients and (forms := point.forms(point.u[None])) is not None:
            found |= {name: float(one[0]) for name, one in forms.items()}
        if special.kind == "hopf" and len(curve.active) == 1:
            found["omega"] = float(np.sqrt(point.u[-1]))
    k = m + len(others)
    extra = special.extra
    if extra is not None and point.made.size > k:
        extra = np.append(point.u[k:], extra[point.made.size - k :])
    return here, replace(special, u=point.u[:m], extra=extra, normal_form=found)


def _hindered(curve: Curve, special: Special) -> str:
    """Why there is no defining system that is square at a point."""
    if special.status != CONVERGED:
        return "the point has not converged"
    if special.kind == "end":
        return "an end of a branch has no equation of its own"
    if len(curve.active) > 2:
        return "a point of a curve in three parameters"
    if special.corank > 1:
        return f"{special.corank} eigenvalues vanish together: a family in more parameters"
    if curve.kind == defining.EQUILIBRIUM:
        if KINDS[special.kind].curve not in SYSTEMS:
            return "two conditions at once on a branch with one parameter"
        if special.extra is None and special.kind != "event":
            return f"its equations were not solved: {special.message}"
    elif curve.kind != defining.EVENT and special.kind == "event":
        return "events on curves in two parameters have no equations of their own"
    return ""


class _Point:
    """A point with the equations that define it, in which all parameters are free."""

    def __init__(self, curve: Curve, special: Special, others: tuple[int, ...]) -> None:
        self.curve, self.special, self.others = curve, special, others
        self.two = len(curve.active) == 2
        kind = curve.kind if self.two else SYSTEMS[KINDS[special.kind].curve or ""]
        extra, aux = (np.zeros(0) if special.extra is None else special.extra), curve.aux
        if not self.two and kind in (defining.HOPF, defining.TORUS):
            extra, aux = extra[: curve.n + 1], extra[curve.n + 1 :]
        values = curve.par[list(others)]
        size = np.where(values != 0.0, np.abs(values), 1.0)
        m = curve.m
        changes = {
            "active": (*curve.active, *others),
            "scale": np.concatenate([curve.scale[:m], size]),
            "period": np.append(curve.period[:m], np.zeros(len(others))),
            "low": np.append(curve.low[:m], np.full(len(others), -np.inf)),
            "high": np.append(curve.high[:m], np.full(len(others), np.inf)),
        }
        self.u = np.concatenate([special.u[:m], values, extra])
        made = curve.replace(**changes)
        if kind in defining.REGULAR:
            held = curve.held if self.two else self._event()
            self.made = made.replace(kind=defining.EVENT, held=held)
        else:
            self.made = extended(made, kind, self.u, extra, aux)
        #: Places of the other parameters, and of the unknowns.
        self.given = np.arange(m, m + len(others))
        self.own = np.delete(np.arange(self.made.size), self.given)

    def _event(self) -> object:
        (event,) = (one for one in self.curve.events if one.name == self.special.name)
        return event

    @property
    def test(self) -> CurveTest | None:
        """What vanishes at a point of codimension two."""
        if not self.two:
            return None
        kinds = [one for one in looked_for_on(self.curve) if one.kind == self.special.kind]
        return kinds[0]

    def _equations(self) -> tuple[Array, Array, Array]:
        """G, and its derivatives by the unknowns and by the other parameters, in their scales."""
        made = self.made
        value, G = made.equations_at(self.u)
        if made.kind == defining.BRANCH and len(made.active) == 3:
            value, G = np.delete(value, -2), np.delete(G, -2, axis=0)  # that branches meet
        if (test := self.test) is not None:
            value = np.append(value, self._value(test, self.u))
            G = np.vstack([G, self._gradient(test)])
        A, B = G[:, self.own] * made.scale[self.own], G[:, self.given] * made.scale[self.given]
        rows = np.max(np.abs(A), axis=1, initial=0.0)
        rows[rows == 0.0] = 1.0
        return value / rows, A / rows[:, None], B / rows[:, None]

    def refined(self) -> bool:
        """Newton's method at the parameters given; whether it converged."""
        before, sizes = np.inf, self.made.scale[self.own]
        for _ in range(STEPS):
            value, A, _ = self._equations()
            if not (np.isfinite(value).all() and np.isfinite(A).all()):
                return False
            try:
                step = np.linalg.solve(A, -value)
            except np.linalg.LinAlgError:
                return False
            size = float(np.max(np.abs(step)))
            if not size < 1e3:
                return False
            self.u[self.own] += step * sizes
            if size <= 1e-14 or (size <= 1e-9 and size >= 0.5 * before):
                return True
            before = size
        return False

    def solved(self, *, coefficients: bool) -> Sensitivity:
        """One linear solve."""
        made, special, k = self.made, self.special, len(self.others)
        _, A, B = self._equations()
        names = [made.field.parameters[i] for i in self.others]
        values = np.linalg.svd(A, compute_uv=False) if np.isfinite(A).all() else np.zeros(1)
        if not values[-1] > SINGULAR * values[0]:
            why = "its defining system is singular there"
            return unknown(self.others, made.n, len(self.curve.active), special.normal_form, why)
        slope = np.zeros((made.size, k))
        slope[self.own] = -np.linalg.solve(A, B) * made.scale[self.own][:, None]
        slope[self.given] = np.diag(made.scale[self.given])
        reasons = [self._lost(slope[:, i], name) for i, name in enumerate(names)]
        form = {name: np.full(k, np.nan) for name in special.normal_form}
        known = np.array([not why for why in reasons])
        rates = self._forms(slope[:, known]) if coefficients and known.any() else {}
        if special.kind == "hopf" and not self.two:  # the last unknown is its square
            rates["omega"] = 0.5 * slope[-1, known] / np.sqrt(self.u[-1])
        for name, value in rates.items():
            form[name][known] = value / made.scale[self.given[known]]
        slope = np.where(known, slope / made.scale[self.given], np.nan)
        m, n = self.curve.m, made.n
        return Sensitivity(self.others, slope[:n], slope[n:m], form, tuple(reasons))

    def _lost(self, slope: Array, name: str) -> str:
        """Why a point does not move with a parameter, which destroys it."""
        if not np.isfinite(slope).all():
            return f"f has no derivative by {name} there"
        if self.made.kind == defining.BRANCH:
            w = self.u[self.made.m : self.made.m + self.made.n]
            sizes = force_sizes(self.curve, self.special.u)
            # b of f + b w = 0, in units of f.
            if abs(slope[-1]) * float(np.max(np.abs(w) / sizes)) > STAYS:
                return f"{name} destroys the branch point: without a symmetry the branches part"
        return ""

    def _value(self, test: CurveTest, at: Array) -> float:
        made = self.made
        return float(test.values(made, at[None], made.evaluate(at)[1][None])[0])

    def _gradient(self, test: CurveTest) -> Array:
        """Derivatives of a function of the curve by all unknowns, by differences."""
        made, u = self.made, self.u
        steps = STEP * np.maximum(made.scale, np.abs(u))

        def value(at: Array) -> float:
            return self._value(test, at)

        out = np.zeros(made.size)
        for j in range(made.size):
            step = np.zeros(made.size)
            step[j] = steps[j]
            out[j] = sum(c * value(u + s * step) for s, c in STENCIL) / steps[j]
        return out

    def _forms(self, slope: Array) -> dict[str, Array]:
        """Derivatives of the coefficients of the normal form along lines, by differences."""
        made = self.made
        lengths = np.max(np.abs(slope[: made.m]) / made.scale[: made.m, None], axis=0)
        steps = STEP / lengths
        places, weights = np.array(STENCIL).T
        lines = (steps * slope).T
        # Of each place of the stencil all lines.
        at = (self.u + places[:, None, None] * lines).reshape(-1, len(self.u))
        found = self.forms(at)
        if found is None:
            return {}
        return {
            name: weights @ one.reshape(len(weights), -1) / steps for name, one in found.items()
        }

    def forms(self, at: Array) -> dict[str, Array] | None:
        """Coefficients of the normal form at points beside; None of kinds without."""
        found = None if self.two else self._together(at)
        if found is not None:
            return found
        if (form := self._form()) is None:
            return None
        rows = [form(Derivatives(self.made, one), one) for one in at]
        names = self.special.normal_form
        return {name: np.array([row.get(name, np.nan) for row in rows]) for name in names}

    def _together(self, at: Array) -> dict[str, Array] | None:
        """Those of regular points, in one compiled call; None if one is none or of another sign."""
        curve, special, m = self.curve, self.special, self.curve.m
        pars = np.repeat(curve.par[None], len(at), axis=0)
        pars[:, list(self.others)] = at[:, self.given]
        found = forms_beside(curve, special, pars, at[:, :m], at[:, m + len(self.others) :])
        if found is None:
            return None
        near = all(
            np.max(np.abs(found[name] - value)) < 0.5 * abs(value)
            for name, value in special.normal_form.items() if name in found
        )  # fmt: skip
        return found if near else None

    def _form(self) -> Form | None:
        """The normal form at a point beside."""
        if (test := self.test) is not None:
            return lambda d, u: test.form(d)[0]
        return _FORMS.get(self.special.kind)


_FORMS: dict[str, Form] = {
    "fold": lambda d, u: fold.normal_form(d),
    "hopf": lambda d, u: pair.normal_form(d, float(np.sqrt(u[-1]))),
    "period_doubling": lambda d, u: period_doubling.normal_form(d),
    "torus": lambda d, u: torus.normal_form(d, float(np.arccos(1.0 - 0.5 * u[-1]))),
}
