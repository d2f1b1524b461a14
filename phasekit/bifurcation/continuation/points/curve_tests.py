"""All test functions along branches of equilibria and curves in two parameters."""

from __future__ import annotations

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import EQUILIBRIUM, EVENT
from phasekit.bifurcation.continuation.points import (
    bogdanov_takens,
    cusp,
    generalized_hopf,
    hopf_hopf,
    of_maps,
    on_events,
    zero_hopf,
)
from phasekit.bifurcation.continuation.points.curve_test import CurveTest
from phasekit.bifurcation.special_points import KINDS, functions_along, look_for

for _test in (
    *cusp.TESTS, *bogdanov_takens.TESTS, *generalized_hopf.TESTS, *zero_hopf.TESTS,
    *hopf_hopf.TESTS, *of_maps.TESTS, *on_events.TESTS,
):  # fmt: skip
    look_for(_test)


def looked_for_on(curve: Curve) -> list[CurveTest]:
    """Those of a curve."""
    asked = (None, *curve.detect)
    return [
        test
        for test in functions_along(curve.kind)
        if curve.n >= test.states
        and curve.discrete in test.of
        and (curve.kind not in (EQUILIBRIUM, EVENT) or KINDS[test.kind].detected in asked)
    ]
