"""What is recorded along a branch: formulas, functions of the user, or quantities by name."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import xarray as xr

from phasekit.arrays import Array
from phasekit.errors import ParameterError, warn
from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, whole
from phasekit.laws.formulas import symbols_of, take_formula, write_formula
from phasekit.systems.problem import Problem

#: Quantities of a system at rest, by the function of phasekit that has them at a state.
_AT_REST: dict[str, tuple[str, str]] = {
    "energy_integral": ("phasekit.labelled.energy", "energy"),
    "potential": ("phasekit.labelled.energy", "potential"),
    "potential_curvature": ("phasekit.labelled.energy", "curvature"),
    "force": ("phasekit.labelled.loads", "bearing_forces"),
    "force_magnitude": ("phasekit.labelled.loads", "bearing_forces"),
    "force_axial": ("phasekit.labelled.loads", "bearing_forces"),
    "deviation_couple": ("phasekit.labelled.loads", "bearing_forces"),
    "drive_torque": ("phasekit.labelled.loads", "bearing_forces"),
}


def offered() -> list[str]:
    """Names of quantities that can be recorded of a system."""
    return [name for name, (module, _) in _AT_REST.items() if importlib.util.find_spec(module)]


def recorded(
    problem: Problem, ds: xr.Dataset, free: Sequence[str], record: Mapping[str, Any]
) -> dict[str, Any]:
    """The recorded quantities as variables on the dim ``point``."""
    made: dict[str, Any] = {}
    for name, function in record.items():
        if isinstance(function, Fourier):
            raise bad(f"record[{name!r}]", function, "nothing of periodic orbits on equilibria")
        if function is None:
            made[name] = _quantity(problem, ds, free, name)
        else:
            made[name] = _values(problem, ds, free, name, function)
    return made


def _values(
    problem: Problem, ds: xr.Dataset, free: Sequence[str], name: str, function: Callable[..., Any]
) -> xr.DataArray:
    if problem.blocks:
        parts = [ds[block.name].values for block in problem.blocks]
        x = np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1).T
    else:
        x = np.array([ds[state].values for state in problem.state])
    varying = {key: ds[key].values for key in free}
    fixed = {key: value for key, value in problem.parameters.items() if key not in varying}
    values, failed = values_along(f"record[{name!r}]", function, x, varying, fixed)
    tell_failed(name, failed, x.shape[1], "points")
    dims = ("point", *(f"{name}_{k}" for k in range(values.ndim - 1)))
    return xr.DataArray(values, dims=dims)


def values_along(
    argument: str, function: Callable[..., Any], x: Array, varying: Mapping[str, Array],
    fixed: Mapping[str, float],
) -> tuple[Array, list[Exception]]:  # fmt: skip
    """A function at all states (state, point), NaN where it raises, and what it raised.

    It is called with all of them at once, if that gives the same, and else with one by one.
    """
    count = x.shape[1]

    def value_at(i: int) -> Any:
        at = {key: float(values[i]) for key, values in varying.items()}
        return np.asarray(function(x[:, i].copy(), **fixed, **at), dtype=float)

    failed: list[Exception] = []

    def value_or_nothing(i: int) -> Any:
        """The value at a point; None where the function raises."""
        try:
            return value_at(i)
        except TypeError as error:
            raise ParameterError(
                f"{argument}: cannot be called as q(x, **parameters): {error}"
            ) from error
        except Exception as error:  # noqa: BLE001 - a user's function, without a value there
            failed.append(error)
            return None

    values = None
    with np.errstate(all="ignore"):
        found = value_or_nothing(0)
        try:  # all points at once, if that gives the same
            whole = np.asarray(function(x.copy(), **fixed, **varying), dtype=float)
            whole = np.moveaxis(whole, -1, 0) if whole.ndim > 1 else whole
            checked = found is not None and whole.shape == (count, *found.shape)
            checked = checked and all(
                np.allclose(whole[i], value_at(i), rtol=1e-12, atol=0.0, equal_nan=True)
                for i in {0, count // 2, count - 1}
            )
            values = whole if checked and count > 3 else None
        except Exception:  # noqa: BLE001 - a function of single points; it is called point by point
            values = None
        if values is None:
            failed.clear()
            rows = [value_or_nothing(i) for i in range(count)]
            shape = next((row.shape for row in rows if row is not None), ())
            values = np.array([np.full(shape, np.nan) if row is None else row for row in rows])
    return values, failed


def tell_failed(name: str, failed: Sequence[Exception], count: int, what: str) -> None:
    """Warn of a function of the user that raised, once for all points."""
    if failed:
        warn(
            f"record[{name!r}]: raised {type(failed[0]).__name__} at {len(failed)} of {count} "
            f"{what}, which are NaN: {failed[0]}",
            RuntimeWarning,
        )


def _quantity(problem: Problem, ds: xr.Dataset, free: Sequence[str], name: str) -> xr.DataArray:
    assert problem.system is not None
    changes = {key: xr.DataArray(ds[key].values, dims="point") for key in free}
    phi = xr.DataArray(ds[problem.state[0]].values, dims="point")
    array = at_rest(problem.system.replace(**changes), name, phi).transpose("point", ...)
    return array.drop_vars([c for c in array.coords if c not in array.dims])


def at_rest(system: Any, name: str, phi: Any) -> xr.DataArray:
    """A quantity of a system at rest at phi."""
    module, attribute = _AT_REST[name]
    function = getattr(importlib.import_module(module), attribute)
    rest = () if attribute in ("potential", "curvature") else (phi * 0.0,)
    found: xr.DataArray = function(system, phi, *rest)[name]
    return found


@functools.lru_cache(64)  # here, and not in what is recorded, which is compared and pickled
def _compiled(formula: Any, states: tuple[str, ...], others: tuple[str, ...]) -> Any:
    import sympy as sp

    symbols = symbols_of([*states, *others])
    arguments = [[symbols[name] for name in states], *(symbols[name] for name in others)]
    return sp.lambdify(arguments, formula, ["scipy", "numpy"])


@dataclass(frozen=True)
class RecordedFormula:
    """A formula of states, parameters and time, for ``record=``."""

    formula: Any
    #: Names of the states of its problem, and of the parameters and the time.
    states: tuple[str, ...] = ()
    others: tuple[str, ...] = ()

    def __call__(self, x: Any, **values: Any) -> Any:
        """The formula at states, once it is known of which problem they are."""
        function = _compiled(self.formula, self.states, self.others)
        with np.errstate(all="ignore"):
            found = function(x, *(values.get(name, 0.0) for name in self.others))
            return found + 0.0 * np.asarray(x)[0]

    def within(self, problem: Any, argument: str) -> Self:
        """The same, with its formula read as one of a problem; its observables have names."""
        others = (*problem.parameters, *([problem.time] if problem.time else []))
        observables = dict(problem.observables)
        symbols = symbols_of([*problem.state, *others, *observables])
        declare = "it is no state, no parameter and no observable"
        formula = take_formula(self.formula, symbols, argument, declare)
        formula = formula.xreplace({symbols[name]: one for name, one in observables.items()})
        return replace(self, formula=formula, states=tuple(problem.state), others=others)

    def written(self) -> Any:
        """It as JSON, for `recorded_as`."""
        return write_formula(self.formula)


@dataclass(frozen=True)
class Fourier(RecordedFormula):
    """A harmonic of a formula along periodic orbits, for ``record=``."""

    order: int = 1

    def written(self) -> Any:
        """It as JSON, for `recorded_as`."""
        return [write_formula(self.formula), self.order]


def recorded_as(written: Any) -> RecordedFormula:
    """The formula or harmonic that was written so."""
    if isinstance(written, str):
        return RecordedFormula(written)
    formula, order = written
    return Fourier(str(formula), order=int(order))


@call_checked
def fourier(formula: Any, order: int) -> Fourier:
    """A harmonic of a formula, to be recorded along branches of periodic orbits.

    Parameters
    ----------
    formula : str or sympy.Expr
        A formula of the states, the parameters and the time, such as the name of a state.
    order : int
        Which harmonic, >= 0; 0 is the mean.

    Returns
    -------
    Fourier
        For ``record=`` of `periodic_orbit`, and of `continuation` along an orbit:
        ``record={"x1": pk.fourier("x", 1)}`` gives ``x1_amplitude`` and ``x1_phase`` of
        ``a cos(w t + p)``.

    Raises
    ------
    ParameterError
        If the order is no whole number.

    Notes
    -----
    ``(2/T) int x exp(-i k w t) dt`` of the piecewise polynomial that solves the orbit. Without
    forcing the time of an orbit begins anywhere, so that phases alone say nothing, and differences
    ``p_k - k p_1`` do. `spectrum` gives all harmonics of one orbit.

    Examples
    --------
    >>> import phasekit as pk
    >>> oscillator = pk.Problem(["y", "mu*(1 - x^2)*y - x"], ("x", "y"), {"mu": 0.1})
    >>> orbit = pk.periodic_orbit(oscillator, [2.0, 0.0])
    >>> branch = pk.continuation(
    ...     oscillator, "mu", orbit=orbit, span=(0.1, 0.3), record={"x3": pk.fourier("x", 3)}
    ... )
    >>> end = branch.points.isel(point=-1)
    >>> round(end.x3_amplitude.item() / end.mu.item(), 2)  # 1/4 to first order
    0.25
    """
    if callable(formula):
        raise bad("formula", formula, "a formula of the states, such as 'x'")
    return Fourier(formula, order=whole("order", order, "a whole number >= 0", 0))
