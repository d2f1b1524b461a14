"""What branches record by formulas: their values, and harmonics of orbits (`fourier`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, whole
from phasekit.laws.formulas import symbols_of, take_formula, write_formula


@dataclass(frozen=True)
class RecordedFormula:
    """A formula of states, parameters and time, for ``record=``."""

    formula: Any
    function: Callable[..., Any] | None = None

    def __call__(self, x: Any, **values: Any) -> Any:
        """The formula at states, once it is known of which problem they are."""
        assert self.function is not None
        return self.function(x, **values)

    def within(self, problem: Any, argument: str) -> Self:
        """The same, with its formula read as one of a problem; its observables have names."""
        import numpy as np
        import sympy as sp

        names = [*problem.state, *problem.parameters, *([problem.time] if problem.time else [])]
        observables = dict(problem.observables)
        symbols = symbols_of([*names, *observables])
        declare = "it is no state, no parameter and no observable"
        formula = take_formula(self.formula, symbols, argument, declare)
        formula = formula.xreplace({symbols[name]: one for name, one in observables.items()})
        states = [symbols[name] for name in problem.state]
        rest = [symbols[name] for name in names[len(states) :]]
        compiled = sp.lambdify([states, *rest], formula, ["scipy", "numpy"])

        def function(x: Any, **values: Any) -> Any:
            with np.errstate(all="ignore"):
                found = compiled(x, *(values.get(str(symbol), 0.0) for symbol in rest))
                return found + 0.0 * np.asarray(x)[0]

        return replace(self, formula=formula, function=function)

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
