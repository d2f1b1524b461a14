"""Damped and driven motions: passes of any perturbed law, and rows of what they are drawn into."""

from __future__ import annotations

from phasekit.laws.perturbed import PerturbedConservative
from phasekit.table.row import LAW, STATE, Pass, Quantity

QUANTITIES: tuple[Quantity, ...] = ()

PASSES: tuple[Pass, ...] = (
    Pass(
        "phasekit.motion.flow:flow",
        (LAW, *STATE, "time"),
        ("motion",),
        PerturbedConservative,
    ),
)
