"""Harmonics that branches of periodic orbits record: `fourier` of a formula."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from phasekit.inputs import call_checked
from phasekit.labels.arguments import bad, whole
from phasekit.laws.formulas import symbols_of, take_formula


@dataclass(frozen=True)
class Fourier:
    """A harmonic of a formula along periodic orbits, for ``record=``."""

    formula: Any
    order: int
    function: Callable[..., Any] | None = None

    def __call__(self, x: Any, **values: Any) -> Any:
        """The formula at states, once it is known of which problem they are."""
        assert self.function is not None
        return self.function(x, **values)

    def within(self, problem: Any, argument: str) -> Fourier:
        """The same, with its formula read as one of a problem.

        Raises
        ------
        ParameterError
            If it is none of its states, parameters and time.
        """
        import numpy as np
        import sympy as sp

        names = [*problem.state, *problem.parameters, *([problem.time] if problem.time else [])]
        symbols = symbols_of(names)
        formula = take_formula(self.formula, symbols, argument, "it is no state and no parameter")
        states = [symbols[name] for name in problem.state]
        rest = [symbols[name] for name in names[len(states) :]]
        compiled = sp.lambdify([states, *rest], formula, ["scipy", "numpy"])

        def function(x: Any, **values: Any) -> Any:
            found = compiled(x, *(values.get(str(symbol), 0.0) for symbol in rest))
            return found + 0.0 * np.asarray(x)[0]

        return Fourier(self.formula, self.order, function)


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
        For ``record=`` of `continuation` along an orbit: ``record={"x1": pk.fourier("x", 1)}``
        gives the columns ``x1_amplitude`` and ``x1_phase`` of ``a cos(w t + p)``.

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
    return Fourier(formula, whole("order", order, "a whole number >= 0", 0))
