"""Rows of rotators and bearing forces: of states, at equilibria, along separatrices and orbits."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from phasekit.table.row import BRANCHES, SIDES, STATE, Pass, Quantity

ROTATORS_OF = "[HedrihVeljovic2011] (5.1), (6.6), corrected"
PRESSURES = "[HedrihVeljovic2013] (22)-(28), corrected"
FIXED_PRESSURES = "[HedrihVeljovic2013] (8), (9), corrected"

#: What rotators need of a machine.
DISK = ("beta", "e", "a", "r", "omega1", "g")
_HEAVY = ("beta", "e", "a", "r", "omega1", "m", "g")
#: What forces at its bearings need.
BORNE = (*_HEAVY, "half_span")
_LOOPS = ("saddle_phi", "saddle_exponent", "turning_offset", "loop")
_MOVED = (("state_ddphi", "ddphi"), ("domega1", "domega1"))

_ROTATOR = ("rotator_name", "carrier_axis")
_FORCE = ("bearing", "disk_axis")
_FIXED = ("fixed_bearing", "carrier_axis")

# fmt: off
QUANTITIES: tuple[Quantity, ...] = (
    Quantity("rotator", "rotators", _ROTATOR, "float64", "s-2",
             "vector rotator, in the carrier frame",
             "R = omega' u + omega^2 [n, u], u = b/|b|; of a coupling: 2 omega1 omega2 b/|b|",
             ROTATORS_OF),
    Quantity("rotator_intensity", "rotators", ("rotator_name",), "float64", "s-2",
             "intensity of the vector rotator", "sqrt(omega'^2 + omega^4), |2 omega1 omega2|",
             "[HedrihVeljovic2011] (4.2), (4.5), (4.7)"),
    Quantity("gamma2", "rotators", (), "float64", "rad",
             "angle of the rotator R022 from its base vector, about n2", "atan2(phi'^2, phi'')",
             "[HedrihVeljovic2011] (4.3)"),
    Quantity("gamma2_rate", "rotators", (), "float64", "s-1",
             "angular velocity of the rotator R022 against the disk",
             "phi' (2 phi''^2 - phi' phi''')/(phi''^2 + phi'^4)",
             "[HedrihVeljovic2011] (4.9), (6.12), corrected"),
    Quantity("hodograph_u", "rotators", (), "float64", "s-2",
             "tangential coordinate of the rotator R022", "phi''", "[HedrihVeljovic2011] (6.11)"),
    Quantity("hodograph_v", "rotators", (), "float64", "s-2",
             "radial coordinate of the rotator R022", "phi'^2",
             "[HedrihVeljovic2011] (6.11), corrected"),
    Quantity("force", "bearing_forces", _FORCE, "float64", "N",
             "reaction of the bearing on the rotor", "F = F_kinetic + F_weight", PRESSURES),
    Quantity("force_kinetic", "bearing_forces", _FORCE, "float64", "N",
             "kinetic part of the reaction on the rotor: minus the kinetic pressure "
             "on the bearing", "Newton-Euler with phi'' of the motion and without the weight",
             PRESSURES),
    Quantity("force_weight", "bearing_forces", _FORCE, "float64", "N",
             "weight part of the reaction on the rotor", "(m g/2) (1 +- (e/l) cos(beta)) n1",
             "[HedrihVeljovic2013] (28), corrected"),
    Quantity("force_magnitude", "bearing_forces", ("bearing",), "float64", "N",
             "size of the force in the bearing", "|F|", PRESSURES),
    Quantity("force_axial", "bearing_forces", (), "float64", "N",
             "reaction of the bearing A2 on the rotor along n2",
             "-m (omega1^2 e cos(beta) + 2 omega1 phi' e sin(beta) cos(phi) + "
             "omega1' (a + e sin(beta) sin(phi)))", "[HedrihVeljovic2013] (19), corrected"),
    Quantity("deviation_couple", "bearing_forces", (), "float64", "N m",
             "couple of the kinetic reactions of both bearings", "|l [n2, F_A2 - F_B2]|",
             "[HedrihVeljovic2013] figure 9, corrected"),
    Quantity("drive_torque", "bearing_forces", (), "float64", "N m",
             "torque about n1 that drives a massless carrier", "(n1, dL_O1/dt)",
             "[HedrihVeljovic2013] (2), with the torque that it omits"),
    Quantity("force_component", "bearing_forces", ("bearing", "component"), "float64", "N",
             "component of the kinetic reaction on the rotor, for constant omega1",
             "F_21 n1 + F_22 w2 - F_23 v01 + F_24 R022/|R022|",
             "[HedrihVeljovic2013] after (28), corrected"),
    Quantity("fixed_force", "fixed_bearing_forces", _FIXED, "float64", "N",
             "reaction of the fixed shaft's bearing on the rotor", "F = F_kinetic + F_weight",
             FIXED_PRESSURES),
    Quantity("fixed_force_kinetic", "fixed_bearing_forces", _FIXED, "float64", "N",
             "kinetic part of the fixed shaft's reaction on the rotor: minus the kinetic pressure "
             "on the bearing", "Newton-Euler with phi'' of the motion and without the weight",
             FIXED_PRESSURES),
    Quantity("fixed_force_weight", "fixed_bearing_forces", _FIXED, "float64", "N",
             "weight part of the fixed shaft's reaction on the rotor", "Newton-Euler at rest",
             FIXED_PRESSURES),
)
# fmt: on


def _at_equilibria(group: str, names: Iterable[str], into: str) -> tuple[Quantity, ...]:
    """Rows of a group that is computed at every equilibrium."""
    return tuple(
        replace(
            row,
            name=f"equilibrium_{row.name}",
            group=into,
            dims=(*BRANCHES, *row.dims),
            long_name=f"{row.long_name}, at the equilibrium",
        )
        for row in QUANTITIES
        if row.group == group and row.name in names
    )


def _loads(
    group: str, dims: tuple[str, ...], units: str, of: str, name: str, source: str
) -> tuple[Quantity, ...]:
    """Rows of what is found along a curve: peak, mean, rms, and the place of the peak."""
    curve = group.partition("_")[0]
    prefix, over = ("orbit_", "time") if curve == "orbit" else ("", "angle")
    place = "peak" if name == "force" else f"{name}_peak"
    rows = (
        (f"peak_{name}", units, f"greatest {of}", f"maximum over the {curve}"),
        (f"mean_{name}", units, f"mean {of}", f"mean over the {over}"),
        (f"rms_{name}", units, f"rms {of}", f"root mean square over the {over}"),
        (f"{place}_phi", "rad", f"angle of the greatest {of}", "phi of the maximum"),
        (f"{place}_dphi", "s-1", f"angular velocity at the greatest {of}", "phi' of the maximum"),
    )
    return tuple(
        Quantity(prefix + row, group, dims, "float64", unit, f"{text} on the {curve}", rule, source)
        for row, unit, text, rule in rows
    )


#: What bearing forces at rest consist of, in the order of `equilibrium_forces`.
_AT_REST = (
    "force",
    "force_kinetic",
    "force_weight",
    "force_magnitude",
    "force_axial",
    "deviation_couple",
)
_FORCE_LOADS = ("N", "force in the bearing", "force", PRESSURES)
_ROTATOR_LOADS = ("s-2", "intensity of the rotator", "intensity", ROTATORS_OF)

QUANTITIES += (
    *_at_equilibria("rotators", ("rotator", "rotator_intensity"), "equilibrium_rotators"),
    *_at_equilibria("bearing_forces", _AT_REST, "equilibrium_forces"),
    *_loads("separatrix_rotators", (*SIDES, "rotator_name"), *_ROTATOR_LOADS),
    *_loads("separatrix_forces", (*SIDES, "bearing"), *_FORCE_LOADS),
    *_loads("orbit_rotators", ("rotator_name",), *_ROTATOR_LOADS),
    *_loads("orbit_forces", ("bearing",), *_FORCE_LOADS),
)

PASSES: tuple[Pass, ...] = (
    Pass(
        "phasekit.mechanics.rotators:rotators",
        (*DISK, *STATE),
        ("rotators",),
        optional=_MOVED,
    ),
    Pass(
        "phasekit.mechanics.bearings:bearing_forces",
        (*BORNE, *STATE),
        ("bearing_forces",),
        optional=_MOVED,
    ),
    Pass(
        "phasekit.mechanics.bearings:fixed_bearing_forces",
        (*_HEAVY, "rho_b1", *STATE),
        ("fixed_bearing_forces",),
        optional=_MOVED,
    ),
    Pass(
        "phasekit.loads.functions:equilibrium_rotators", (*DISK, "phi"), ("equilibrium_rotators",)
    ),
    Pass("phasekit.loads.functions:equilibrium_forces", (*BORNE, "phi"), ("equilibrium_forces",)),
    Pass(
        "phasekit.loads.functions:separatrix_rotators", (*DISK, *_LOOPS), ("separatrix_rotators",)
    ),
    Pass("phasekit.loads.functions:separatrix_forces", (*BORNE, *_LOOPS), ("separatrix_forces",)),
    Pass("phasekit.loads.functions:orbit_rotators", (*DISK, *STATE), ("orbit_rotators",)),
    Pass("phasekit.loads.functions:orbit_forces", (*BORNE, *STATE), ("orbit_forces",)),
)
