"""All test functions along curves in two parameters; one's own are added."""

from __future__ import annotations

from phasekit.bifurcation.continuation.curve import Curve
from phasekit.bifurcation.continuation.kernels.defining import EVENT
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
from phasekit.bifurcation.special_points import KINDS

TESTS: list[CurveTest] = [
    *cusp.TESTS, *bogdanov_takens.TESTS, *generalized_hopf.TESTS, *zero_hopf.TESTS,
    *hopf_hopf.TESTS, *of_maps.TESTS, *on_events.TESTS,
]  # fmt: skip


def add(test: CurveTest) -> CurveTest:
    """Look for the zeros of one more function along curves.

    Raises
    ------
    ValueError
        If its kind is not registered.

    Examples
    --------
    >>> add(CurveTest("swallowtail", 1, lambda curve, u, slopes: u[:, 0]))
    Traceback (most recent call last):
    ValueError: no special point is a 'swallowtail'
    """
    if test.kind not in KINDS:
        raise ValueError(f"no special point is a {test.kind!r}")
    TESTS.append(test)
    return test


def tests_of(curve: Curve) -> list[CurveTest]:
    """Those of a curve."""
    return [
        test
        for test in TESTS
        if test.curve == curve.kind
        and curve.n >= test.states
        and curve.discrete in test.of
        and (curve.kind != EVENT or KINDS[test.kind].detected in (None, *curve.detect))
    ]
