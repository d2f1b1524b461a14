"""`fit`: parameters at which special points, amplitudes and periods have given values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.inputs import call_checked
from phasekit.labelled.continuation.checks import check_parameter
from phasekit.labelled.continuation.moving import Moving, moving
from phasekit.labelled.continuation.special_point import SpecialPoint
from phasekit.labels.arguments import bad, number, whole
from phasekit.labels.equality import equal
from phasekit.labels.grid import LABEL_DTYPE
from phasekit.numerics.waits import notice
from phasekit.systems.problem import Problem, as_problem

WANTS = "a list of (point, quantity, value, error), point being a SpecialPoint"
STEPS = 50
SMALL = 1e-10  # part of the parameters by which a last step changes them
IDENTIFIED = 1e-8  # least part of the largest singular value that tells of a combination
SAME = 1e-9
HIGHEST = 1e12  # of the damping
#: What of two problems is the same where their equations are.
EQUATIONS = ("state", "f", "map", "time", "conservative", "periods")
LOST = "a special point is lost on the way to the targets"


@dataclass(frozen=True, repr=False)
class Fit:
    """Parameters at which targets are met, with their errors.

    Attributes
    ----------
    system : Problem or system
        That of the call, at the fitted parameters.
    parameters : mapping of str to float
        The fitted parameters.
    errors : mapping of str to float
        Their standard errors, from those of the targets; NaN where they are not identified.
    covariance : xarray.DataArray
        Of the fitted parameters, over `parameter` and `other`.
    targets : xarray.Dataset
        Over `target`: its name, the value wanted, its error, the value found, and the residual
        (found - value)/error.
    chi2 : float
        Sum of squares of the residuals.
    status : {"converged", "not identified", "not converged"}
        Only the first says that the parameters are determined and the sum of squares is least
        near them.
    message : str
        What is wrong; of parameters that are not identified which combinations do not matter.
    steps : int
        Steps that were taken.
    """

    system: Any
    parameters: Mapping[str, float]
    errors: Mapping[str, float]
    covariance: xr.DataArray
    targets: xr.Dataset
    chi2: float
    status: str
    message: str
    steps: int

    @property
    def converged(self) -> bool:
        """Whether the parameters are determined and the sum of squares is least near them."""
        return self.status == "converged"

    def __repr__(self) -> str:
        """Write the parameters with their errors, how well the targets are met, and the status."""
        parts = [f"{k}={v:.10g} +- {self.errors[k]:.2g}" for k, v in self.parameters.items()]
        count = self.targets.sizes["target"]
        text = f"{', '.join(parts)}; chi2={self.chi2:.4g} of {count} targets; {self.status}"
        return f"<Fit {text}{': ' + self.message if self.message else ''}>"


@call_checked
def fit(problem: Any, targets: Sequence[Any], *, free: Sequence[str], steps: int = STEPS) -> Fit:
    """Fit parameters so that special points, amplitudes and periods have given values.

    Parameters
    ----------
    problem : Problem or system
        The system, at the parameters to start from.
    targets : sequence of (SpecialPoint, str, float, float)
        What is known: a special point of a branch of this problem, the name of a quantity of it,
        the value that it is to have, and the standard error of that value. Quantities are the
        parameter of the branch, states and coefficients of the normal form of equilibria, the
        period of a Hopf point or cycle, and ``x_min``, ``x_max``, ``x_mean`` and ``x_amplitude``
        (half of the largest less the least) of a state ``x`` of cycles. What cycles and
        equilibria do at given parameters are quantities of events (see Notes).
    free : sequence of str
        The parameters to be fitted.
    steps : int, default 50
        The most steps.

    Returns
    -------
    Fit
        With ``parameters``, ``errors``, ``covariance``, ``targets``, ``chi2``, ``status`` and
        ``system``, the system at the fitted parameters.

    Raises
    ------
    ParameterError
        If an argument is unusable, a point belongs to another problem or has no equations of its
        own, or a quantity is none of it.

    See Also
    --------
    SpecialPoint

    Notes
    -----
    The sum of squares of (found - value)/error is made least by the method of Levenberg and
    Marquardt ([Marquardt1963]) with the derivatives of `SpecialPoint.sensitivity`. At each step the
    equations of each point are solved again, from where its derivatives lead; no branch is
    followed again. The covariance is (J^T J)^-1 at the end, J the derivatives of the residuals.
    Combinations of parameters that change no target are named, and convergence is not announced.

    The height of a cycle at c = 3 is a quantity of the event ``events={"here": "c - 3"}`` of its
    family. A branch has to be followed once, with the parameters to start from, to say which of
    several points is meant.

    Examples
    --------
    >>> import phasekit as pk
    >>> nerve = pk.Problem(
    ...     ["v - v**3/3 - w + I", "eps*(v + a - b*w)"], ("v", "w"),
    ...     {"I": 0.0, "eps": 0.08, "a": 0.7, "b": 0.8},
    ... )
    >>> rest = pk.continuation(nerve, "I", x0=[-1.2, -0.6], span=(0, 2))
    >>> low, high = rest.special("H")
    >>> targets = [(low, "I", 0.35, 0.001), (high, "I", 1.4, 0.001)]
    >>> found = pk.fit(nerve, targets, free=["a", "b"])
    >>> found.status, round(found.parameters["a"], 4)
    ('converged', 0.7107)
    """
    given, problem = problem, as_problem(problem)
    steps = whole("steps", steps, "a whole number >= 1", 1)
    names = _free(problem, free)
    wanted = _targets(problem, targets)
    with notice(f"fitting {', '.join(names)}"):
        search = _Search(problem, wanted, names)
        message = search.run(steps)
        return search.result(given, message)


def _free(problem: Problem, free: Any) -> tuple[str, ...]:
    if isinstance(free, str) or not isinstance(free, Sequence) or not len(free):
        raise bad("free", free, "a list of names of parameters")
    names = tuple(check_parameter(problem, name) for name in free)
    if len(set(names)) < len(names):
        raise bad("free", free, "names that differ")
    return names


@dataclass(frozen=True)
class _Target:
    """A quantity of one of the points, and what it is to be."""

    place: int
    quantity: str
    value: float
    error: float
    name: str


def _targets(problem: Problem, targets: Any) -> tuple[list[SpecialPoint[Any]], list[_Target]]:
    """The points, each once, and the targets."""
    if isinstance(targets, (str, Mapping)) or not isinstance(targets, Sequence) or not len(targets):
        raise bad("targets", targets, WANTS)
    points: list[SpecialPoint[Any]] = []
    found: list[_Target] = []
    for i, one in enumerate(targets):
        if not isinstance(one, (tuple, list)) or len(one) != 4:
            raise bad(f"targets[{i}]", one, "(point, quantity, value, error)")
        point, quantity, value, error = one
        if not isinstance(point, SpecialPoint):
            raise bad(f"targets[{i}][0]", point, "a SpecialPoint, such as branch.special('H')[0]")
        _check_problem(i, problem, point)
        value = number(f"targets[{i}][2]", value, "a number", None)
        error = number(f"targets[{i}][3]", error, "a number > 0", None)
        if not error > 0.0:
            raise bad(f"targets[{i}][3]", error, "a number > 0")
        places = [k for k, other in enumerate(points) if other is point]
        if not places:
            places = [len(points)]
            points.append(point)
        if not isinstance(quantity, str):
            raise bad(f"targets[{i}][1]", quantity, "the name of a quantity")
        found.append(_Target(places[0], quantity, value, error, point.name or point.label))
    labels = [point.name or point.label for point in points]
    for i, one in enumerate(found):  # of several points of one label each has a number
        count = labels[: one.place].count(one.name) + 1
        label = f"{one.name} {count}" if labels.count(one.name) > 1 else one.name
        found[i] = replace(one, name=f"{label} {one.quantity}")
    return points, found


def _check_problem(i: int, problem: Problem, point: SpecialPoint[Any]) -> None:
    other = point.branch.problem
    same = type(other) is type(problem) and list(other.parameters) == list(problem.parameters)
    if not same or not all(equal(getattr(other, k), getattr(problem, k)) for k in EQUATIONS):
        hint = "its equations are others; follow the branch of the problem"
        raise bad(f"targets[{i}][0]", point, "a point of a branch of the problem itself", hint)
    for name, value in problem.parameters.items():
        gap = abs(point.parameters[name] - value)
        if name not in point.branch.free and gap > SAME * max(abs(value), 1e-300):
            raise bad(
                f"targets[{i}][0]", point, "a point of a branch of the problem itself",
                f"it was found at {name} = {point.parameters[name]:.9g}, the problem has "
                f"{value:.9g}: follow the branch of the problem",
            )  # fmt: skip


class _Search:
    """The method of Levenberg and Marquardt."""

    def __init__(
        self, problem: Problem, wanted: tuple[list[SpecialPoint[Any]], list[_Target]],
        names: tuple[str, ...],
    ) -> None:  # fmt: skip
        points, self.targets = wanted
        self.problem, self.names = problem, names
        self.at = np.array([problem.parameters[name] for name in names], dtype=float)
        self.moving: list[Moving] = []
        for i, point in enumerate(points):
            one = moving(point, [t.quantity for t in self.targets if t.place == i])
            if isinstance(one, str):
                raise bad("targets", point, "points with equations of their own", one)
            self.moving.append(one)
        for i, target in enumerate(self.targets):
            valid = self.moving[target.place].numbers
            if target.quantity not in valid:
                raise bad(f"targets[{i}][1]", target.quantity, f"one of {', '.join(valid)}")
        self.taken = 0

    def residuals(self, points: list[Moving]) -> Array:
        """How far the targets are missed, beside their errors."""
        gaps = [
            (points[t.place].numbers[t.quantity] - t.value) / t.error for t in self.targets
        ]  # fmt: skip
        return np.array(gaps)

    def slopes(self) -> Array:
        """Derivatives of the residuals by the free parameters."""
        columns = [one.slopes(self.names) for one in self.moving]
        return np.array([columns[t.place][t.quantity] / t.error for t in self.targets])

    def run(self, steps: int) -> str:
        """Take steps until they are nothing; what is wrong."""
        damping, J = 0.0, self.slopes()
        r = self.residuals(self.moving)
        while self.taken < steps:
            if not np.isfinite(J).all():
                return self._lost()
            size = np.where(self.at != 0.0, np.abs(self.at), 1.0)
            step = _step(J * size, r, damping) * size
            small = bool(np.all(np.abs(step) <= SMALL * size))
            made = self._moved(self.at + step)
            self.taken += 1
            fresh = None if made is None else self.residuals(made)
            ended = small and damping == 0.0
            better = fresh is not None and fresh @ fresh < r @ r
            if made is not None and fresh is not None and (better or ended):
                self.at, self.moving, r = self.at + step, made, fresh
                J, damping = self.slopes(), (0.0 if damping < 1e-6 else 0.1 * damping)
                if ended:
                    return ""
                continue
            if small:  # no way down that rounding leaves
                return "" if made is not None else LOST
            damping = max(1e-3, 10.0 * damping)
            if damping > HIGHEST:
                return LOST
        return f"{steps} steps were not enough"

    def _lost(self) -> str:
        reasons = [one.reason(self.names) for one in self.moving]
        return f"derivatives are not known: {next((one for one in reasons if one), 'not finite')}"

    def _moved(self, at: Array) -> list[Moving] | None:
        """All points at other parameters; None if one of them is lost."""
        values = dict(zip(self.names, at.tolist(), strict=True))
        found = [one.moved(values) for one in self.moving]
        made = [one for one in found if one is not None]
        return made if len(made) == len(found) else None

    def result(self, given: Any, message: str) -> Fit:
        """What was found."""
        r, J = self.residuals(self.moving), self.slopes()
        if not message and not np.isfinite(J).all():  # so nothing tells that the sum is least
            message = self._lost()
        size = np.where(self.at != 0.0, np.abs(self.at), 1.0)
        count = len(self.names)
        covariance = np.full((count, count), np.nan)
        status = "not converged" if message else "converged"
        if np.isfinite(J).all():
            _, values, V = np.linalg.svd(J * size, full_matrices=True)
            values = np.append(values, np.zeros(max(0, count - len(values))))
            lost = values <= IDENTIFIED * values[0]
            words = [self._combination(V[k] * size) for k in np.flatnonzero(lost)]
            if words:
                status = "not identified" if not message else status
                told = f"no target changes with {'; nor with '.join(words)}"
                message = f"{message}; {told}" if message else told
            with np.errstate(divide="ignore"):
                parts = V * size / np.where(lost, np.inf, values)[:, None]
            covariance = parts.T @ parts
            # What takes part in a combination that is not identified has no error that is known.
            hidden = np.any(np.abs(V[lost]) > IDENTIFIED, axis=0)
            covariance[hidden], covariance[:, hidden] = np.nan, np.nan
        values_at = dict(zip(self.names, self.at.tolist(), strict=True))
        errors = np.sqrt(np.diag(covariance)).tolist()
        name = np.array(self.names, dtype=LABEL_DTYPE)
        targets = xr.Dataset(
            {
                "value": ("target", [t.value for t in self.targets]),
                "error": ("target", [t.error for t in self.targets]),
                "found": (
                    "target",
                    [self.moving[t.place].numbers[t.quantity] for t in self.targets],
                ),
                "residual": ("target", r),
            },
            {"target": np.array([t.name for t in self.targets], dtype=LABEL_DTYPE)},
        )
        return Fit(
            given.replace(**values_at), MappingProxyType(values_at),
            MappingProxyType(dict(zip(self.names, errors, strict=True))),
            xr.DataArray(covariance, {"parameter": name, "other": name}, ("parameter", "other")),
            targets, float(r @ r), status, message, self.taken,
        )  # fmt: skip

    def _combination(self, direction: Array) -> str:
        """A combination of parameters in words."""
        part = direction / np.max(np.abs(direction))
        part = part * np.sign(part[np.argmax(np.abs(part))])
        terms = [
            f"{value:+.3g} in {name}"
            for name, value in zip(self.names, part.tolist(), strict=True)
            if abs(value) > 1e-6
        ]  # fmt: skip
        return f"a change of {', '.join(terms)}"


def _step(J: Array, r: Array, damping: float) -> Array:
    """The damped step of least length, of what is identified."""
    U, values, V = np.linalg.svd(J, full_matrices=False)
    kept = values > IDENTIFIED * max(values[0], 1e-300)
    part = np.zeros_like(values)
    part[kept] = values[kept] / (values[kept] ** 2 + damping * values[0] ** 2)
    return np.asarray(-V.T @ (part * (U.T @ r)))
