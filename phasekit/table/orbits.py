"""Rows of orbits and motions."""

from __future__ import annotations

from phasekit.errors import OrbitFamily, OrbitKind
from phasekit.laws.trigonometric import Trigonometric
from phasekit.table.row import ABC, BRANCHES, FROM_ENERGY, FROM_MOTION, SADDLES, Pass, Quantity

ACTION_ANGLE = f"{FROM_ENERGY}; [LandauLifshitz1976] section 50"
SMALL = f"expansion of {FROM_MOTION}; [LandauLifshitz1976] section 28"

# fmt: off
QUANTITIES: tuple[Quantity, ...] = (
    Quantity("orbit_kind", "orbits", (), "int8", "1", "kind of the orbit",
             "sign of h - V(phi_s); equilibrium: phi' = 0 and V'(phi) = 0", FROM_ENERGY,
             OrbitKind),
    Quantity("orbit_energy", "orbits", (), "float64", "s-2", "energy of the orbit",
             "h = phi'^2/2 + V(phi)", FROM_ENERGY),
    Quantity("period", "orbits", (), "float64", "s",
             "period of the orbit, infinite on a separatrix",
             "T = closed integral of dphi/phi' (rotation: over 2 pi)", FROM_ENERGY,
             general="T = closed integral of dphi/phi' (rotation: over the circle)"),
    Quantity("frequency", "orbits", (), "float64", "s-1", "angular frequency of the orbit",
             "2 pi/T", FROM_ENERGY),
    Quantity("action", "orbits", (), "float64", "s-1",
             "area inside the orbit, or under one turn of a rotation, over 2 pi",
             "J = (1/2 pi) closed integral of phi' dphi (rotation: over 2 pi)", ACTION_ANGLE,
             general="J = (1/2 pi) closed integral of phi' dphi (rotation: over the circle)"),
    Quantity("phi_min", "orbits", (), "float64", "rad",
             "least angle of the orbit, NaN for a rotation", "V(phi_min) = h", FROM_ENERGY),
    Quantity("phi_max", "orbits", (), "float64", "rad",
             "greatest angle of the orbit, NaN for a rotation", "V(phi_max) = h", FROM_ENERGY),
    Quantity("amplitude", "orbits", (), "float64", "rad",
             "half the angle between the turning points, NaN for a rotation",
             "(phi_max - phi_min)/2", FROM_ENERGY),
    Quantity("orbit_family", "action_angle", (), "int8", "1", "family of the orbit",
             "by the centers that a libration goes round, or the sign of phi' of a rotation",
             FROM_ENERGY, OrbitFamily, of=Trigonometric),
    Quantity("angle", "action_angle", (), "float64", "rad",
             "angle variable: 0 at phi_max, of a rotation at the lower center",
             "theta' = 2 pi/T, in [0, 2 pi)", ACTION_ANGLE),
    Quantity("twist", "action_angle", (), "float64", "1",
             "change of the frequency with the action", "d(2 pi/T)/dJ", ACTION_ANGLE,
             of=Trigonometric),
    Quantity("phi_of_angle", "state_of", (), "float64", "rad",
             "angle at given action and angle variable",
             "phi after the time theta T/(2 pi) from theta = 0", ACTION_ANGLE),
    Quantity("dphi_of_angle", "state_of", (), "float64", "s-1",
             "angular velocity at given action and angle variable",
             "phi' after the time theta T/(2 pi) from theta = 0", ACTION_ANGLE),
    Quantity("motion_phi", "motion", (), "float64", "rad", "angle, continuous in time",
             "phi'' = -V'(phi)", FROM_MOTION),
    Quantity("motion_dphi", "motion", (), "float64", "s-1", "angular velocity",
             "phi'' = -V'(phi)", FROM_MOTION),
    Quantity("near_center_period", "near_center", BRANCHES, "float64", "s",
             "period of small oscillations about the center, to first order in the energy",
             "(2 pi/w) (1 + eps (5 V'''^2/(24 w^6) - V''''/(8 w^4))), w^2 = V''", SMALL),
    Quantity("near_center_frequency", "near_center", BRANCHES, "float64", "s-1",
             "angular frequency of small oscillations, to first order in the energy",
             "w - eps (5 V'''^2/(24 w^5) - V''''/(8 w^3)), w^2 = V''", SMALL),
    Quantity("near_separatrix_period", "near_separatrix", SADDLES, "float64", "s",
             "period next to the separatrix of the saddle, to leading order in the gap",
             "(n/k) ln(32 k^6/(|gap| |D|)), heteroclinic: (2/k) ln(8 k^4/(|gap| |A|))",
             f"expansion of {FROM_ENERGY}"),
    Quantity("energy_level", "orbit_families", ("family",), "float64", "s-2",
             "energy of the orbit", "h = phi'^2/2 + V(phi)", FROM_ENERGY),
)
# fmt: on

PASSES: tuple[Pass, ...] = (
    Pass(
        "phasekit.phase.exact.action_angle:orbits_with_angles",
        (*ABC, "state_phi", "state_dphi"),
        ("orbits", "action_angle"),
    ),
    Pass("phasekit.phase.exact.orbits:orbits", (*ABC, "state_phi", "state_dphi"), ("orbits",)),
    Pass(
        "phasekit.phase.exact.action_angle:state_of_numbers",
        (*ABC, "state_action", "state_angle", "state_family"),
        ("state_of",),
    ),
    Pass("phasekit.phase.exact.flow:flow", (*ABC, "state_phi", "state_dphi", "time"), ("motion",)),
    Pass("phasekit.phase.exact.asymptotics:near_center", (*ABC, "state_excess"), ("near_center",)),
    Pass(
        "phasekit.phase.exact.asymptotics:near_separatrix",
        (*ABC, "state_gap"),
        ("near_separatrix",),
    ),
    Pass(
        "phasekit.phase.exact.orbits:orbits_at_energy",
        (*ABC, "state_energy"),
        ("orbits",),
        options=("center",),
    ),
    Pass(
        "phasekit.phase.exact.orbits:orbits_at_gap",
        (*ABC, "state_gap"),
        ("orbits",),
        options=("saddle", "side"),
    ),
    Pass(
        "phasekit.phase.exact.flow:separatrix_motion",
        (*ABC, "time"),
        ("motion",),
        options=("saddle", "side"),
    ),
)
