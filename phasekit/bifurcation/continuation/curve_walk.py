"""How curves of equilibria and of special points are walked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from phasekit.bifurcation.continuation.acceptance import on_bound
from phasekit.bifurcation.continuation.conserved import deficient, not_isolated
from phasekit.bifurcation.continuation.curve import Curve, Stop, Track
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM
from phasekit.bifurcation.continuation.options import ContinuationOptions
from phasekit.bifurcation.continuation.path import Sample, join
from phasekit.bifurcation.continuation.placed import Placed
from phasekit.bifurcation.continuation.specials import find
from phasekit.bifurcation.continuation.stops import place_of

Array = npt.NDArray[np.float64]

START = 1e-6  # distance on scaled axes within which a point is the start itself


@dataclass(frozen=True)
class CurveWalk:
    """A curve as a `Walker`; its steps are made by compiled code, many at a time."""

    curve: Curve
    chunk: ClassVar[int] = 32
    looks_back: ClassVar[bool] = True

    @property
    def options(self) -> ContinuationOptions:
        """How far and how finely."""
        return self.curve.options

    @property
    def ends(self) -> tuple[str, ...]:
        """Kinds, labels and names of special points at which it ends."""
        return self.curve.ends

    def hindered(self, start: Sample) -> Stop | None:
        """Why there is no branch: equilibria that are not isolated."""
        curve = self.curve
        if curve.kind != EQUILIBRIUM or not deficient(curve, start.u, start.slopes):
            return None
        why = not_isolated(curve, start.u[: curve.m], place_of(curve, start.u))
        return Stop("stuck", why) if why else None

    def turned(self, start: Sample) -> Sample:
        """The start in the other direction."""
        return Sample(start.u, -start.tangent, start.slopes)

    def begin(self, start: Sample) -> Array:
        """The state of a walk that begins at a point."""
        return self.curve.start_state(start.u, start.tangent)

    def follow(self, state: Array, points: int, start: Sample) -> Track:
        """At most so many points from a state."""
        return on_bound(self.curve, self.curve.follow(state, points))

    def passed(self, start: Sample, track: Track, since: int) -> list[Placed]:
        """Special points from one of its points on."""
        placed = find(self.curve, join(self.curve, start, None, track)).placed
        return [one for one in placed if one.index >= since]

    def is_start(self, seen: Placed, start: Sample) -> bool:
        """Whether a special point is the start itself."""
        curve = self.curve
        gap = np.zeros(curve.size)
        gap[: curve.m] = seen.special.u[: curve.m] - start.u[: curve.m]
        return not curve.length(gap) > START

    def within(self, state: Array) -> bool:
        """Whether a state stands inside its bounds; vectors of curves have some as well."""
        u = state[: len(self.curve.low)]
        return bool(np.all((u > self.curve.low) & (u < self.curve.high)))

    def words(self, seen: Placed) -> str:
        """Where a special point is."""
        curve = self.curve
        names = [*curve.field.states, *(curve.field.parameters[i] for i in curve.active)]
        return ", ".join(f"{name} = {seen.special.u[i]:.9g}" for i, name in enumerate(names[:4]))
