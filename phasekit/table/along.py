"""What maps of branches hold: rows by the names of the states and of the parameter along these."""

from __future__ import annotations

from enum import IntEnum

from phasekit.errors import BranchStatus, PointStatus, SpecialPointKind
from phasekit.labels.arguments import bad
from phasekit.labels.coordinates import LABELS
from phasekit.laws.equations import Equations
from phasekit.laws.ladder import Flow, Law, Map
from phasekit.table.row import Quantity

#: Cells of a tile at most: a branch takes milliseconds, and neighbours are looked at together.
CELLS = 1024
GROUPS = ("branch_status", "special_points", "n_stable", "hysteresis")
#: What takes families of periodic orbits as well.
OF_CYCLES = "period"
#: What special points are counted by, their labels, and the rows of their numbers.
COUNTED = {
    "LP": "n_fold",
    "BP": "n_branch_point",
    "H": "n_hopf",
    "PD": "n_period_doubling",
    "TR": "n_torus",
}
#: The coefficient of the normal form that says most of a kind.
COEFFICIENT = {
    "fold": "a", "hopf": "l1", "pitchfork": "c", "transcritical": "a", "period_doubling": "c",
    "torus": "d",
}  # fmt: skip
TRACED = "[AllgowerGeorg1990] 6; [Kuznetsov2004] 10"


def rows_of(law: Equations, parameter: str) -> dict[str, Quantity]:
    """Rows that a map of branches of one system has, by name.

    >>> from phasekit.laws.equations import Rates
    >>> rows = rows_of(Rates(("x", "y"), ("a", "b"), None), "a")
    >>> rows["special_a"].dims, rows["hysteresis"].label_shape
    (('special_point',), (0, 2))
    """
    rung: type[Law] = Map if isinstance(law, Map) else Flow
    rest = "fixed points" if rung is Map else "equilibria"
    labels = {
        **LABELS,
        "special_point": (range(0), f"special point, by {parameter}"),
        "interval": (range(0), f"interval of {parameter}"),
        "cycle_family": (range(0), f"family of periodic orbits, by {parameter} at its Hopf point"),
        "oscillation_interval": (range(0), f"interval of {parameter}"),
        "bistable_interval": (range(0), f"interval of {parameter}"),
        "end": (("low", "high"), "end of an interval"),
    }
    for name in (parameter, *law.states):
        if name in ("kind", "status", "coefficient"):
            wants = "other names of states and of the parameter than kind, status, coefficient"
            raise bad("system", name, wants)

    def row(
        name: str, group: str, dims: tuple[str, ...], dtype: str, units: str, text: str,
        equation: str, flags: type[IntEnum] | None = None,
    ) -> Quantity:  # fmt: skip
        return Quantity(
            name, group, dims, dtype, units, text, equation, TRACED, flags=flags, of=rung,
            labels=labels, most_cells=CELLS,
        )  # fmt: skip

    unit = {name: law.units.get(name, "1") for name in (parameter, *law.states)}
    each, both = ("special_point",), "f = 0, and the equations of its kind"
    found = [
        row("branch_status", "branch_status", (), "int8", "1",
            f"whether all branches of {rest} in the window at the ends of the span were followed",
            "box proofs at both ends of the span", BranchStatus),
        row("special_kind", "special_points", each, "int8", "1", "kind of the special point",
            "by its defining equations", SpecialPointKind),
        row(f"special_{parameter}", "special_points", each, "float64", unit[parameter],
            f"{parameter} at the special point", both),
        *(row(f"special_{name}", "special_points", each, "float64", unit[name],
              f"{name} at the special point", both) for name in law.states),
        row("special_coefficient", "special_points", each, "float64", "1",
            "coefficient of the normal form: a of a fold, l1 of a Hopf point, ...", "normal form"),
        row("special_status", "special_points", each, "int8", "1",
            "whether the special point converged", "Newton's method", PointStatus),
        *(row(name, "special_points", (), "int64", "1",
              f"number of special points {label} on all branches; -1: not computed", both)
          for label, name in COUNTED.items()),
        row("n_stable", "n_stable", (), "int64", "1",
            f"greatest number of stable {rest} at one value of {parameter}; -1: not computed",
            "all eigenvalues inside the border"),
        row("hysteresis", "hysteresis", ("interval", "end"), "float64", unit[parameter],
            f"interval of {parameter} with two or more stable {rest}", "stable branches overlap"),
        row("n_hysteresis", "hysteresis", (), "int64", "1",
            "number of such intervals; -1: not computed", "stable branches overlap"),
        row("hysteresis_width", "hysteresis", (), "float64", unit[parameter],
            "length of the intervals of hysteresis", "sum of high - low"),
    ]  # fmt: skip
    if rung is Flow:
        family, when = ("cycle_family", "end"), "x(t + T) = x(t)"
        found += [
            row("period", OF_CYCLES, family, "float64", law.units.get("time", "1"),
                "least and greatest period of the family that begins at a Hopf point", when),
            row("cycle_extent", OF_CYCLES, family, "float64", unit[parameter],
                f"least and greatest {parameter} of its orbits", when),
            *(row(f"cycle_{name}", OF_CYCLES, family, "float64", unit[name],
                  f"least and greatest {name} on its orbits", when) for name in law.states),
            row("n_cycle_families", OF_CYCLES, (), "int64", "1",
                "number of families from Hopf points; -1: not computed", when),
            row("oscillation", OF_CYCLES, ("oscillation_interval", "end"), "float64",
                unit[parameter], f"interval of {parameter} with a stable cycle",
                "multipliers inside the unit circle"),
            row("bistability", OF_CYCLES, ("bistable_interval", "end"), "float64",
                unit[parameter],
                f"interval of {parameter} with two or more stable equilibria or cycles",
                "stable branches and families overlap"),
        ]  # fmt: skip
    return {one.name: one for one in found}
