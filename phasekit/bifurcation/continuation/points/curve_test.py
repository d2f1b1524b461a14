"""Test functions along branches and curves: what a special point on them is known by."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from phasekit.arrays import Array
from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.derivatives import Derivatives
from phasekit.bifurcation.continuation.path import Sample


@dataclass(frozen=True)
class CurveTest:
    """A function along equilibria or curves of a kind, and the special points its zeros are.

    Attributes
    ----------
    kind : str
        A kind of the registry of special points.
    along : int
        EQUILIBRIUM, FOLD, HOPF, BRANCH or EVENT; of maps FLIP or TORUS, too.
    values : callable
        Its values at points (rows of unknowns, with the derivatives of f at each).
    states : int
        The least number of states with which there are such points.
    holds : callable
        Whether a zero is such a point.
    of : tuple of bool
        Whether there are such points of flows (False), of maps (True), or of both.
    coefficient : str
        What messages call the function.
    form : callable
        The normal form at a point of the derivatives given, and what is to be said of it.
    oriented : bool
        Whether ``values`` takes the unit tangents as well.
    """

    kind: str
    along: int
    values: Callable[..., Array]
    states: int = 1
    holds: Callable[[Curve, Sample], bool] = lambda curve, s: True
    of: tuple[bool, ...] = (False,)
    coefficient: str = ""
    form: Callable[[Derivatives], tuple[dict[str, float], str]] = lambda d: ({}, "")
    oriented: bool = False

    def value(self, curve: Curve, s: Sample) -> float:
        """The function at one point."""
        return float(self.along_path(curve, s.u[None], s.slopes[None], s.tangent[None])[0])

    def along_path(self, curve: Curve, u: Array, slopes: Array, tangent: Array) -> Array:
        """The function at points of a path."""
        return self.values(curve, u, slopes, *((tangent,) if self.oriented else ()))
