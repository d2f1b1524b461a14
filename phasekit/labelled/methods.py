"""How the quantities of a system are computed: the one place where labelled functions ask.

``system.methods`` names the passes that compute groups of the table. Systems with coefficients
(A, B, C) share `CLOSED_FORM`; a `Potential` brings numerical methods of its own.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import Any, Protocol

import numpy as np

from phasekit.errors import EquilibriumKind
from phasekit.labelled.arguments import FloatArray, one_of
from phasekit.labelled.quantities import LABELS, Pass, Quantity, plan_passes
from phasekit.phase.equilibria import equilibria
from phasekit.phase.flow import separatrix_motion
from phasekit.phase.orbits import Orbits, orbits_at_energy, orbits_at_gap

CENTERS = ("lower_center", "upper_center")
SADDLES, SIDES = LABELS["saddle"][0], LABELS["side"][0]
DEFAULT_SADDLE = "lower where there is one, else upper"

#: A pass, and what is noted of the arguments that it was made from.
Noted = tuple[Pass, dict[str, str]]


class Methods(Protocol):
    """What labelled functions ask of a system."""

    #: Whether the shape of a cell's results is the same in all maps, so that tiles fit together.
    by_tiles: bool

    def passes(self, rows: Iterable[Quantity]) -> tuple[Pass, ...]:
        """Return the passes that compute rows of the table."""

    def fitted(
        self, rows: Sequence[Quantity], passes: Sequence[Pass]
    ) -> tuple[Sequence[Quantity], Sequence[Pass]]:
        """Return rows and passes with the labels and words that this system's results have."""

    def at_energy(self, center: str | int | None) -> Noted:
        """Return the pass for orbits by their energy round a center."""

    def at_gap(self, saddle: str | int | None, side: str) -> Noted:
        """Return the pass for orbits by their energy above a saddle."""

    def on_separatrix(self, saddle: str | int | None, side: str) -> Noted:
        """Return the pass for motion on the separatrix of a saddle."""


class ClosedForm:
    """Closed forms in (A, B, C)."""

    by_tiles = True

    def passes(self, rows: Iterable[Quantity]) -> tuple[Pass, ...]:
        """Return the passes that compute rows of the table."""
        return plan_passes(rows)

    def fitted(
        self, rows: Sequence[Quantity], passes: Sequence[Pass]
    ) -> tuple[Sequence[Quantity], Sequence[Pass]]:
        """Return rows and passes as they are: the table is written for these systems."""
        return rows, passes

    def at_energy(self, center: str | int | None) -> Noted:
        """Return the pass for orbits by their energy round a center."""
        name = CENTERS[0] if center is None else center
        function = functools.partial(orbits_at_energy, center=one_of("center", name, CENTERS))
        return Pass(function, ("A", "B", "C", "state_energy"), ("orbits",)), {"center": str(name)}

    def at_gap(self, saddle: str | int | None, side: str) -> Noted:
        """Return the pass for orbits by their energy above a saddle."""
        number = None if saddle is None else one_of("saddle", saddle, SADDLES)
        function = functools.partial(_at_gap, number, one_of("side", side, SIDES))
        one = Pass(function, ("A", "B", "C", "state_gap"), ("orbits",))
        return one, {"saddle": str(saddle or DEFAULT_SADDLE), "side": side}

    def on_separatrix(self, saddle: str | int | None, side: str) -> Noted:
        """Return the pass for motion on the separatrix of a saddle."""
        number = -1 if saddle is None else one_of("saddle", saddle, SADDLES)
        function = functools.partial(
            separatrix_motion, saddle=number, side=one_of("side", side, SIDES)
        )
        one = Pass(function, ("A", "B", "C", "time"), ("motion",))
        return one, {"saddle": str(saddle or DEFAULT_SADDLE), "side": side}


CLOSED_FORM = ClosedForm()


def _at_gap(
    saddle: int | None, side: int, A: FloatArray, B: FloatArray, C: FloatArray, gap: FloatArray
) -> Orbits:
    chosen: Any = saddle
    if saddle is None:
        lower = equilibria(A, B, C).kind[..., 1] == EquilibriumKind.SADDLE
        chosen = np.where(lower, 0, 1)
    return orbits_at_gap(A, B, C, gap, chosen, side)
