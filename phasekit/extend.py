"""What extensions are made of: quantities, torques of a frame, special points, pictures.

Systems need none of it: a class with `phasekit.System`, `phasekit.parameter` and a law is one. The
contributing guide shows an example of each extension.

========================  ==========================================================================
a quantity                `Quantity`, `Pass`, `add_quantity`; its rung: `Trigonometric`,
                          `Conservative`, `Routhian`
a torque of the frame     `Rate`
a kind of special point   `PointKind`, `add_point_kind`; on curves in two parameters `CurveTest`,
                          `add_curve_test`, and the curve that it is of: `FOLD`, `HOPF`, `BRANCH`,
                          of maps `FLIP`, `TORUS`
a picture                 `axes_for`, `label`, `shown`
========================  ==========================================================================

Examples
--------
>>> import phasekit as pk
>>> pk.extend.Quantity.__name__, pk.extend.Pass.__name__
('Quantity', 'Pass')
"""

from phasekit.bifurcation.continuation.kernels.defining import BRANCH, FLIP, FOLD, HOPF, TORUS
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.continuation.points.curve_tests import add as add_curve_test
from phasekit.bifurcation.special_points import PointKind
from phasekit.bifurcation.special_points import register as add_point_kind
from phasekit.laws.ladder import Conservative, Routhian
from phasekit.laws.perturbed import Rate
from phasekit.laws.trigonometric import Trigonometric
from phasekit.plot.parts.labels import label, shown
from phasekit.plot.parts.style import axes_for
from phasekit.table.quantities import add as add_quantity
from phasekit.table.row import Pass, Quantity

__all__ = [
    "BRANCH",
    "FLIP",
    "FOLD",
    "HOPF",
    "TORUS",
    "Conservative",
    "CurveTest",
    "Pass",
    "PointKind",
    "Quantity",
    "Rate",
    "Routhian",
    "Trigonometric",
    "add_curve_test",
    "add_point_kind",
    "add_quantity",
    "axes_for",
    "label",
    "shown",
]
