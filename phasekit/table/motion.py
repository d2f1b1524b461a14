"""Damped and driven motions: passes of any perturbed law, and rows of what they are drawn into."""

from __future__ import annotations

from phasekit.laws.perturbed import PerturbedConservative
from phasekit.table.row import LAW, STATE, Pass, Quantity

QUANTITIES: tuple[Quantity, ...] = ()

#: What is said of rows that other laws have as well.
PERTURBED: dict[str, dict[str, str]] = {
    "motion_phi": {"equation": "phi'' + V'(phi; p(t)) = -d phi' - q |phi'| phi' + N + F(t)"},
    "motion_dphi": {"equation": "phi'' + V'(phi; p(t)) = -d phi' - q |phi'| phi' + N + F(t)"},
}

PASSES: tuple[Pass, ...] = (
    Pass(
        "phasekit.motion.flow:flow",
        (LAW, *STATE, "time"),
        ("motion",),
        PerturbedConservative,
    ),
)
