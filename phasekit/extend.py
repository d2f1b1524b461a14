"""What extensions are made of, and the names of phasekit that ``dir(pk)`` does not list.

Systems need none of it: a class with `phasekit.System`, `phasekit.parameter` and a law is one, and
a class with `phasekit.Term` and a force is a term. The contributing guide has an example of each.

========================  ==========================================================================
a quantity                `Quantity`, `Pass`, `add_quantity`; its rung: `Trigonometric`,
                          `Conservative`, `Routhian`, `Flow`, `Map`
where it is computed      `Standing`, a rung with the `Trait`s that terms bring in
a torque of the frame     `Rate`
a kind of special point   `PointKind`, `add_point_kind`; where its function is zero, by
                          `add_point_test`: a `CurveTest` along `EQUILIBRIUM` branches or the
                          curves `FOLD`, `HOPF`, `BRANCH`, of maps `FLIP`, `TORUS`; an `OrbitTest`
                          along a ``"cycle"`` family or the curves ``"fold_of_cycles"``,
                          ``"period_doubling"``, ``"torus"``, ``"cycle_branch_point"``, or
                          ``"fold"`` of a `BoundaryProblem`
a picture                 `axes_for`, `label`, `shown`
========================  ==========================================================================

``pk.extend.NAME`` is ``pk.NAME`` too for what is asked for more rarely: classes of results, codes,
errors, systems of single fields, and functions beside the main ones.

Examples
--------
>>> import phasekit as pk
>>> pk.extend.RigidBody is pk.RigidBody
True
>>> pk.extend.Quantity.__name__, pk.extend.Pass.__name__
('Quantity', 'Pass')
"""

from typing import Any as _Any

import phasekit as _phasekit
from phasekit.bifurcation.continuation.kernels.defining import (
    BRANCH,
    EQUILIBRIUM,
    FLIP,
    FOLD,
    HOPF,
    TORUS,
)
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.special_points import PointKind
from phasekit.bifurcation.special_points import look_for as add_point_test
from phasekit.bifurcation.special_points import register as add_point_kind
from phasekit.cycles.on_curves import OrbitTest
from phasekit.laws.ladder import Conservative, Flow, Map, Routhian, Standing, Trait
from phasekit.laws.terms import Rate
from phasekit.laws.trigonometric import Trigonometric
from phasekit.plot.parts.labels import label, shown
from phasekit.plot.parts.style import axes_for
from phasekit.table.quantities import add as add_quantity
from phasekit.table.row import Pass, Quantity

__all__ = [
    "BRANCH",
    "EQUILIBRIUM",
    "FLIP",
    "FOLD",
    "HOPF",
    "TORUS",
    "Conservative",
    "CurveTest",
    "Flow",
    "Map",
    "OrbitTest",
    "Pass",
    "PointKind",
    "Quantity",
    "Rate",
    "Routhian",
    "Standing",
    "Trait",
    "Trigonometric",
    "add_point_kind",
    "add_point_test",
    "add_quantity",
    "axes_for",
    "label",
    "shown",
]


def __getattr__(name: str) -> _Any:
    if name in _phasekit.__all__ and not name.startswith("_"):
        return getattr(_phasekit, name)
    from phasekit.labels.arguments import unknown

    text = f"module 'phasekit.extend' has no attribute {name!r}"
    raise AttributeError(text if name.startswith("__") else str(unknown("name", name, __dir__())))


def __dir__() -> list[str]:
    rest = set(_phasekit.__all__) - set(dir(_phasekit)) - {"__version__"}
    return sorted({*__all__, *rest})
