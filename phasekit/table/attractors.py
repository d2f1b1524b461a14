"""Attractors and basins of laws with states of their own: rows by the names of the states."""

from __future__ import annotations

from phasekit.errors import AttractorKind
from phasekit.labels.coordinates import LABELS
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Flow, Law, Map
from phasekit.table.motion import EXPONENTS, RECURRENCE
from phasekit.table.row import Quantity

#: On maps there is place for so many attractors.
SLOTS = 8
#: Cells of a tile at most: each takes a good part of a second.
CELLS = 16
_ATTRACTOR = ("attractor",)
_NUMBERED = {**LABELS, "attractor": (range(SLOTS), LABELS["attractor"][1])}


def rows_of(law: Equations) -> dict[str, Quantity]:
    """What is said of attractors and basins of one system, by name."""
    rung: type[Law] = Map if isinstance(law, Map) else Flow
    free = rung is Flow and law.time is None
    leg = "iterations" if rung is Map else "periods of the forcing"
    every = "after equal times" if free else f"once in each of the {leg}"
    per = f"per {leg[:-1]}" if rung is Map else "per unit of time"

    def row(
        name: str, group: str, dims: tuple[str, ...], dtype: str, text: str, equation: str,
        units: str = "1", source: str = RECURRENCE, flags: type[AttractorKind] | None = None,
    ) -> Quantity:  # fmt: skip
        return Quantity(
            name, group, dims, dtype, units, text, equation, source, flags=flags, of=rung,
            labels=_NUMBERED, most_cells=CELLS,
        )  # fmt: skip

    place = "the first of which is the least" if not free else "along one period of a cycle"
    found = [
        *(
            row(f"attractor_{x}", "attractors", _ATTRACTOR, "float64",
                f"{x} on the attractor, {every}, {place}", f"{x}(n T)", law.units.get(x, "1"))
            for x in law.states
        ),
        row("attractor_kind", "attractors", _ATTRACTOR, "int8", "kind of the attractor",
            "by its return and its exponents", flags=AttractorKind),
        row("attractor_period", "attractors", _ATTRACTOR, "float64" if free else "int64",
            f"{'time' if free else leg} after which the attractor repeats itself, 0: it does not",
            "least T > 0 with x(t + T) = x(t)", law.units.get("time", "1") if free else "1"),
        row("attractor_multiplier", "attractors", _ATTRACTOR, "float64",
            "greatest modulus of the attractor's multipliers over its period, without the one "
            "along a cycle of a flow; NaN where it has none",
            "max |eigenvalue of the derivative of the return|"),
        row("attractor_exponent", "attractors", _ATTRACTOR, "float64",
            f"largest Lyapunov exponent on the attractor, {per}", "mean growth of log|u|",
            source=EXPONENTS),
        row("attractor_exponent_error", "attractors", _ATTRACTOR, "float64",
            "estimated error of the exponent, 0 where it comes from multipliers or eigenvalues",
            "of the mean over 18 parts of the time, or their trend", source=EXPONENTS),
        row("n_attractors", "attractors", (), "int64",
            "number of attractors found, including those that are not numbered", "attractors of "
            "motions from a grid of states"),
        row("basin_fraction", "basin_fractions", _ATTRACTOR, "float64",
            "share of the states in the attractor's basin", "number of states over all"),
        row("basin_fraction_error", "basin_fractions", _ATTRACTOR, "float64",
            "error of the share: that of a sample of as many states, and the undecided",
            "sqrt(f (1 - f)/N + 1/(4 N^2))/(1 + 1/N) + undecided"),
        row("remaining_fraction", "basin_fractions", (), "float64",
            "share of the states that reach none of the numbered attractors: undecided, to "
            "infinity, or to others", "1 - sum of the shares"),
        row("escaped_fraction", "basin_fractions", (), "float64",
            "share of the states from which motions run to infinity", "number of states over all"),
        row("basin", "basins", (), "int16",
            "attractor of the motion; -1: undecided, -2: to infinity",
            "first state near the attractor"),
        row("basin_decided", "basins", (), "bool",
            "whether the errors of the steps stayed smaller than a cell until the motion was "
            "caught, so that they do not decide where it comes to", "10 rtol max|u| < cell"),
        row("basin_time", "basins", (), "float64",
            f"{'iterations' if rung is Map else 'time'} until the motion is seen to come to its "
            "attractor", "first state that is caught"),
        row("boundary_fraction", "basins", (), "float64",
            "share of the states beside another basin", "number of cells over all"),
    ]  # fmt: skip
    turning = [name for name in law.states if name in law.periods]
    per = per if free else f"per one of the {leg}"
    if turning[:1] == list(law.states[:1]):
        found.append(
            row("attractor_rotation", "attractors", _ATTRACTOR, "float64",
                f"turns of {turning[0]} on the attractor, {per}",
                f"({turning[0]}(t) - {turning[0]}(0))/(turn t)")
        )  # fmt: skip
    return {one.name: one for one in found}
