"""Rows of perturbed systems: what damping and drive do to first order."""

from __future__ import annotations

from phasekit.laws.perturbed import PerturbedConservative, PerturbedTrigonometric
from phasekit.table.row import LAW, SIDES, Pass, Quantity

MELNIKOV = "[GuckenheimerHolmes1983] section 4.5; [Melnikov1963]"

_GENERAL = PerturbedConservative

# fmt: off
QUANTITIES: tuple[Quantity, ...] = (
    Quantity("melnikov_mean", "melnikov", SIDES, "float64", "s-2",
             "mean of Melnikov's function: energy that the loop gains on average",
             "-damping S - quadratic int |phi'|^3 dt + torque (phi(inf) - phi(-inf)) - dS/dt",
             MELNIKOV, of=_GENERAL),
    Quantity("melnikov_amplitude", "melnikov", SIDES, "float64", "s-2",
             "greatest oscillation of Melnikov's function against its mean",
             "|int phi' f(phi) exp(i nu t) dt| of the drive f(phi) cos(nu t)", MELNIKOV,
             of=_GENERAL),
    Quantity("melnikov_phase", "melnikov", SIDES, "float64", "rad",
             "phase of the oscillation of Melnikov's function, NaN with several frequencies",
             "M(t0) = mean + amplitude cos(nu t0 + phase)", MELNIKOV, of=_GENERAL),
    Quantity("chaos_threshold", "melnikov", SIDES, "float64", "s-2",
             "amplitude of the first harmonic of the drive, the others in proportion, from which "
             "on stable and unstable manifold intersect transversally",
             "forcing_amplitude |mean|/amplitude", MELNIKOV, of=_GENERAL),
    Quantity("turnstile_area", "melnikov", SIDES, "float64", "s-1",
             "area of a turnstile of the undamped system: what crosses in one period of the drive",
             "integral of the positive part of M(t0) over one period; 2 amplitude/nu",
             "[MacKayMeissPercival1984]; " + MELNIKOV, of=_GENERAL),
    Quantity("quiet_frequency", "quiet_frequencies", SIDES, "float64", "s-1",
             "least frequency of a torque to which the lobe does not respond to first order; its "
             "multiples are the others",
             "nu x = pi, cosh(k (x + i y)) = (-S + i k^2)/sqrt(D)", MELNIKOV,
             of=PerturbedTrigonometric),
)
# fmt: on

_MELNIKOV = "phasekit.perturbation.melnikov:"

PASSES: tuple[Pass, ...] = (
    Pass(_MELNIKOV + "melnikov", (LAW,), ("melnikov",), PerturbedTrigonometric),
    Pass(_MELNIKOV + "quiet_frequency", (LAW,), ("quiet_frequencies",), PerturbedTrigonometric),
)
