"""Test functions along a path of equilibria: what is found where one changes its sign."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.events import Bracket
from phasekit.bifurcation.continuation.points.special import Special


@dataclass(frozen=True)
class PathTest:
    """A change along a path that `spectrum` sees, and the special points that it tells of.

    Attributes
    ----------
    change : str
        What a bracket says of the test function that changed its sign.
    points : callable
        The special points of a bracket, beside those that were found in it before.
    discrete : bool, optional
        Whether it holds of maps alone, or of flows alone; by default of both.
    """

    change: str
    points: Callable[[Curve, Bracket, list[Special]], list[Special]]
    discrete: bool | None = None

    def found_in(self, curve: Curve, bracket: Bracket, known: list[Special]) -> list[Special]:
        """The special points of a bracket; none where this has not changed."""
        if self.change not in bracket.changes or self.discrete not in (None, curve.discrete):
            return []
        return self.points(curve, bracket, known)
