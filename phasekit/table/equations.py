"""What sweeps offer of laws with states of their own: rows by the names of the states."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from phasekit.errors import FlowEquilibriumKind
from phasekit.labels.coordinates import LABELS
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Flow, Law, Map
from phasekit.table import attractors
from phasekit.table.motion import EXPONENTS, RECURRENCE
from phasekit.table.row import Quantity

#: Cells of a tile at most, where one takes milliseconds, or a good part of a second.
MILLISECONDS, LONG = 256, attractors.CELLS
#: What is asked of a function along an attractor.
EXTREMA = ("min", "max", "mean")
ZEROS = "[MooreKearfottCloud2009]"


def is_formula(key: str) -> bool:
    """Whether a function along attractors is called by its formula, ``(x*y)``, not by a name."""
    return key.startswith("(")


def parts_along(key: str) -> tuple[str, ...]:
    """Names of what is said of a function along an attractor, by its name or its formula.

    >>> parts_along("x")[1::3], parts_along("(x*y)")[1::3]
    (('max_x', 'max_x_error'), ('max(x*y)', 'max(x*y)_error'))
    """
    tail = key if is_formula(key) else f"_{key}"
    return (*(f"{part}{tail}" for part in EXTREMA), f"min{tail}_error", f"max{tail}_error")


def rows_of(
    law: Equations, formulas: Mapping[str, Any] = MappingProxyType({})
) -> dict[str, Quantity]:
    """Rows that a sweep of one system has, by name; formulas of its states besides.

    Units of a formula in which something has units are unknown, "".

    >>> from phasekit.laws.equations import Step
    >>> rows = rows_of(Step(("x", "y"), ("a",), None))
    >>> rows["max_y"].group, rows["eigenvalue"].label_shape
    ('extrema', (0, 2))
    """
    rung: type[Law] = Map if isinstance(law, Map) else Flow
    n, steps = len(law.states), rung is Map
    what, over = ("fixed point", "|multiplier| > 1") if steps else ("equilibrium", "Re > 0")
    unit = {name: law.units.get(name, "1") for name in law.states}
    labels = {
        **LABELS,
        "equilibrium": (range(0), f"{what}, by its number"),
        "state": (law.states, "state"),
        "eigenvalue_number": (range(n), "eigenvalue, the least stable first"),
        "exponent": (range(1, n + 1), LABELS["exponent"][1]),
    }

    def row(
        name: str, group: str, dims: tuple[str, ...], dtype: str, units: str, text: str,
        equation: str, source: str, cells: int, flags: type[FlowEquilibriumKind] | None = None,
    ) -> Quantity:  # fmt: skip
        return Quantity(
            name, group, dims, dtype, units, text, equation, source, flags=flags, of=rung,
            labels=labels, most_cells=cells,
        )  # fmt: skip

    each = ("equilibrium",)
    zero = "f(x) = x" if steps else "f(x) = 0"
    units, parts = next(iter(unit.values())), ""
    if len(set(unit.values())) > 1:  # no one unit holds, and "1" would say that there is none
        units, parts = "", ": " + ", ".join(f"{name} ({of})" for name, of in unit.items())
    found = [] if law.time is not None else [
        row("x", "equilibria", (*each, "state"), "float64", units, f"state of the {what}{parts}",
            zero, ZEROS, MILLISECONDS),
        row("eigenvalue", "equilibria", (*each, "eigenvalue_number"), "complex128", "1",
            "eigenvalue of the derivatives of f, the least stable first", "det(f_x - s) = 0",
            ZEROS, MILLISECONDS),
        row("kind", "equilibria", each, "int8", "1", f"kind of the {what}",
            "by its eigenvalues", ZEROS, MILLISECONDS, FlowEquilibriumKind),
        row("n_unstable", "equilibria", each, "int64", "1", "number of unstable eigenvalues",
            over, ZEROS, MILLISECONDS),
        row("n_equilibria", "equilibria", (), "int64", "1",
            f"number of {'fixed points' if steps else 'equilibria'} in the window; -1: the "
            "parameters are no numbers", zero, ZEROS, MILLISECONDS),
        row("n_stable", "equilibria", (), "int64", "1", "number of those that attract",
            "all eigenvalues inside the border", ZEROS, MILLISECONDS),
        row("complete", "equilibria", (), "bool", "1",
            "whether these are proved to be all in the window", zero, ZEROS, MILLISECONDS),
    ]  # fmt: skip
    per = "iteration" if steps else "unit of time"
    leg = "iterations" if steps else "periods of the forcing" if law.time else "time"
    found += [
        row("lyapunov_exponent", "lyapunov", ("exponent",), "float64", "1",
            f"Lyapunov exponent per {per}, the largest first", "mean growth of log|u|, u' = f_x u",
            EXPONENTS, MILLISECONDS),
        row("lyapunov_error", "lyapunov", ("exponent",), "float64", "1",
            "estimated error of the Lyapunov exponent",
            "of the mean over 18 parts of the time, or their trend", EXPONENTS, MILLISECONDS),
        row("lyapunov_sum", "lyapunov", (), "float64", "1", "sum of all Lyapunov exponents",
            "mean of tr f_x" if not steps else "mean of log|det f_x|", EXPONENTS, MILLISECONDS),
        row("lyapunov_dimension", "lyapunov", (), "float64", "1", "Kaplan and Yorke's dimension",
            "k + (l_1 + ... + l_k)/|l_(k+1)|", EXPONENTS, MILLISECONDS),
        row("period", "period", (), "float64",
            "1" if steps or law.time else law.units.get("time", "1"),
            f"{leg} after which the attractor of the motion repeats itself; 0: it does not; NaN: "
            "the motion is lost or undecided", "least T > 0 with x(t + T) = x(t)", RECURRENCE,
            LONG),
    ]  # fmt: skip
    for key in (*law.states, *formulas):
        name = key[1:-1].strip() if is_formula(key) else key
        along = f"{name}(t)" if name == key else f"({name})(t)"
        own = law.units_along(formulas[key]) if key in formulas else unit[name]
        words = (
            ("least", f"min {along}"), ("greatest", f"max {along}"), ("mean", f"mean of {along}"),
            ("estimated error of the least", f"error of min {along}"),
            ("estimated error of the greatest", f"error of max {along}"),
        )  # fmt: skip
        found += [
            row(title, "extrema", (), "float64", own,
                f"{text} {name} along the attractor of the motion", equation, RECURRENCE, LONG)
            for title, (text, equation) in zip(parts_along(key), words, strict=True)
        ]  # fmt: skip
    over_grid = attractors.rows_of(law).values()
    found += [one for one in over_grid if one.group in ("attractors", "basin_fractions")]
    return {one.name: one for one in found}
