"""The table of quantities: what phasekit computes on a map, one row each.

Labelled functions, sweeps, the attributes of stored maps and the reference pages all follow from
this table. A new quantity is a row in `QUANTITIES` and a line in `PASSES` that names the array
function which computes it; nothing else has to change.

In derived units the radian is 1 and left out: angles are in rad, rates in s-1, energies (per unit
of inertia about the shaft) in s-2, areas of the phase plane and actions in s-1.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

import numpy as np

from phasekit.errors import (
    EquilibriumKind,
    Loop,
    OrbitFamily,
    OrbitKind,
    ParameterError,
    Topology,
)
from phasekit.labels.arguments import bad, unknown
from phasekit.labels.coordinates import LABELS, STATES, Labels
from phasekit.laws.ladder import Conservative, Law, Routhian
from phasekit.laws.trigonometric import Trigonometric

FROM_ENERGY = "[Veljovic2015] (14), corrected coefficients"
FROM_MOTION = "[Veljovic2015] (12), corrected coefficients"
ACTION_ANGLE = f"{FROM_ENERGY}; [LandauLifshitz1976] section 50"
ROTATORS_OF = "[HedrihVeljovic2011] (5.1), (6.6), corrected"
PRESSURES = "[HedrihVeljovic2013] (22)-(28), corrected"
FIXED_PRESSURES = "[HedrihVeljovic2013] (8), (9), corrected"
ROUTH_OF = "Routh's reduction; [Veljovic2015] (11) with omega1 free, corrected"
SMALL = f"expansion of {FROM_MOTION}; [LandauLifshitz1976] section 28"


@dataclass(frozen=True, slots=True)
class Quantity:
    """One row: a variable of a labelled result."""

    name: str
    group: str
    dims: tuple[str, ...]
    dtype: str
    units: str
    long_name: str
    equation: str
    source: str
    flags: type[IntEnum] | None = None
    #: The most general rung of the ladder of laws on which it is computed.
    of: type[Law] = Law
    #: The equation in any potential, where `equation` is that of (A, B, C).
    general: str = ""
    #: Labels of the row's dims where they are not those of the table.
    labels: Mapping[str, Labels] | None = field(default=None, compare=False)

    @property
    def attrs(self) -> dict[str, Any]:
        """Attributes of the variable, as they stand in every Dataset."""
        attrs: dict[str, Any] = {
            "long_name": self.long_name,
            "units": self.units,
            "equation": self.equation,
            "source": self.source,
        }
        if self.flags is not None:
            attrs["flag_values"] = np.array([flag.value for flag in self.flags], dtype=np.int8)
            attrs["flag_meanings"] = " ".join(flag.name.lower() for flag in self.flags)
        return attrs

    def variant(self, rung: type[Law]) -> Mapping[str, str]:
        """What is said of it on a rung below that of (A, B, C): equation, source, units, ..."""
        if issubclass(rung, Routhian):
            return ROUTH.get(self.name, {})
        return {"equation": self.general} if self.general else {}

    @property
    def label_shape(self) -> tuple[int, ...]:
        """Lengths of the label dims."""
        return tuple(len(self.labels_of(dim)[0]) for dim in self.dims)

    def labels_of(self, dim: str) -> Labels:
        """Labels of a dim, with its long name."""
        return (self.labels or LABELS)[dim]

    @property
    def cell_bytes(self) -> int:
        """Bytes that one cell of a map takes."""
        return int(np.prod(self.label_shape, dtype=int)) * np.dtype(self.dtype).itemsize


@dataclass(frozen=True, slots=True)
class Pass:
    """One call of an array function, which computes whole groups at once.

    `inputs` are coefficients (A, B, C), parameters, states, or quantities of other groups; those
    come with their label axes last. `LAW` among them is the law itself, with its parameters after
    it. The function returns one result a group, each a NamedTuple whose fields are named as the
    quantities, or arrays in the order of the group's rows.
    """

    function: str | Callable[..., Any]  # "module:name", imported when it is first needed
    inputs: tuple[str, ...]
    groups: tuple[str, ...]
    #: The rung of the ladder of laws for which it holds.
    of: type[Law] = Trigonometric
    #: Keywords that a call has to say: numbers of a center or saddle, a side.
    options: tuple[str, ...] = ()
    #: States that it can do without, with their keywords.
    optional: tuple[tuple[str, str], ...] = ()

    @property
    def resolved(self) -> Callable[..., Any]:
        """The function."""
        if not isinstance(self.function, str):
            return self.function
        module, _, name = self.function.partition(":")
        function: Callable[..., Any] = getattr(importlib.import_module(module), name)
        return function

    def call(self, *arrays: Any) -> dict[str, Any]:
        """Return the arrays by the names of the quantities."""
        result = self.resolved(*arrays)
        results = result if len(self.groups) > 1 else (result,)
        named: dict[str, Any] = {}
        for group, part in zip(self.groups, results, strict=True):
            names = [row.name for row in ROWS.values() if row.group == group]
            if names[0] in getattr(part, "_fields", ()):
                named.update(part._asdict())
            else:
                named.update(zip(names, part if isinstance(part, tuple) else (part,), strict=True))
        return named


_BRANCHES = ("equilibrium",)
_SADDLES = ("saddle",)
_SIDES = ("saddle", "side")
_ROTATOR = ("rotator_name", "carrier_axis")
_FORCE = ("bearing", "disk_axis")
_FIXED = ("fixed_bearing", "carrier_axis")

# fmt: off
QUANTITIES: tuple[Quantity, ...] = (
    Quantity("potential", "potential", (), "float64", "s-2", "potential",
             "V = -B cos(phi) + (A/2) cos(phi)^2 - C sin(phi)",
             "[Veljovic2015] (15) plus Omega^2/2, corrected coefficients"),
    Quantity("potential_gradient", "potential_gradient", (), "float64", "s-2",
             "gradient of the potential",
             "V' = B sin(phi) - A sin(phi) cos(phi) - C cos(phi)", FROM_MOTION,
             general="V'"),
    Quantity("potential_curvature", "potential_curvature", (), "float64", "s-2",
             "curvature of the potential",
             "V'' = B cos(phi) - A cos(2 phi) + C sin(phi)", "derivative of " + FROM_MOTION,
             general="V''"),
    Quantity("energy_integral", "energy_integral", (), "float64", "s-2", "energy integral",
             "h = phi'^2/2 + V(phi)", FROM_ENERGY),
    Quantity("phase_velocity", "phase_velocity", (), "float64", "s-1",
             "angular velocity at given energy, NaN where the energy is too low",
             "phi' = sqrt(2 (h - V(phi)))", FROM_ENERGY),
    Quantity("phi", "equilibria", _BRANCHES, "float64", "rad", "angle of the equilibrium",
             "V'(phi) = 0", FROM_MOTION),
    Quantity("kind", "equilibria", _BRANCHES, "int8", "1", "kind of the equilibrium",
             "center: V'' > 0, saddle: V'' < 0, degenerate: V'' = 0", FROM_MOTION,
             EquilibriumKind),
    Quantity("energy", "equilibria", _BRANCHES, "float64", "s-2",
             "potential at the equilibrium", "V(phi)", FROM_ENERGY),
    Quantity("curvature", "equilibria", _BRANCHES, "float64", "s-2",
             "curvature of the potential at the equilibrium",
             "V''(phi) = B cos(phi) - A cos(2 phi) + C sin(phi)", FROM_MOTION),
    Quantity("natural_frequency", "equilibria", _BRANCHES, "float64", "s-1",
             "angular frequency of small oscillations about the center", "sqrt(V''(phi))",
             FROM_MOTION),
    Quantity("exponent", "equilibria", _BRANCHES, "float64", "s-1",
             "exponent of the saddle", "k = sqrt(-V''(phi))", FROM_MOTION),
    Quantity("n_equilibria", "equilibria", (), "int8", "1",
             "number of distinct equilibria, -1 where the system is not valid",
             "sign of Delta = (B^2 + C^2 - A^2)^3 + 27 A^2 B^2 C^2", FROM_MOTION,
             general="changes of sign of V' between the zeros of V''"),
    Quantity("fold_margin", "equilibria", (), "float64", "1",
             "distance from the fold, > 0 where four equilibria exist",
             "1 - (|B/A|^(2/3) + |C/A|^(2/3))^(3/2)", FROM_MOTION,
             of=Trigonometric),
    Quantity("topology", "separatrices", (), "int8", "1", "topology of the separatrices",
             "by the number of saddles and the order of their energies", FROM_ENERGY, Topology,
             general="by what the separatrices of all saddles do"),
    Quantity("figure_eight", "separatrices", (), "bool", "1",
             "whether a separatrix has the shape of a figure-eight (the trigger of coupled "
             "singularities: center, saddle, center)",
             "Delta < 0 and the saddles' energies differ", FROM_ENERGY,
             general="V = h_s on both sides of a saddle, before a saddle as high"),
    Quantity("saddle_phi", "separatrices", _SADDLES, "float64", "rad", "angle of the saddle",
             "V'(phi_s) = 0, V''(phi_s) < 0", FROM_MOTION),
    Quantity("saddle_energy", "separatrices", _SADDLES, "float64", "s-2",
             "energy of the separatrix", "h_s = V(phi_s)", FROM_ENERGY),
    Quantity("saddle_exponent", "separatrices", _SADDLES, "float64", "s-1",
             "exponent of the saddle", "k = sqrt(-V''(phi_s))", FROM_MOTION),
    Quantity("loop", "separatrices", _SADDLES, "int8", "1",
             "what the separatrix of the saddle does",
             "sign of D = (A^2/4) sin(2 phi_s)^2 + (B cos(phi_s) + C sin(phi_s)) k^2",
             FROM_ENERGY, Loop,
             general="where V = h_s again on either side of the saddle"),
    Quantity("winding_area", "separatrices", _SADDLES, "float64", "s-1",
             "area under one branch of the winding separatrix",
             "integral of |phi'| over 2 pi at h = h_s", FROM_ENERGY,
             general="integral of |phi'| over the circle at h = h_s"),
    Quantity("turning_offset", "separatrices", _SIDES, "float64", "rad",
             "signed angle from the saddle to the turning point, or to the partner saddle",
             "phi_t - phi_s", FROM_ENERGY),
    Quantity("turning_phi", "separatrices", _SIDES, "float64", "rad",
             "angle of the turning point of the separatrix, or of the partner saddle",
             "phi_t = -phi_s +- arccos(cos(2 phi_s) - 2 k^2/A)", FROM_ENERGY,
             general="V(phi_t) = h_s"),
    Quantity("lobe_area", "separatrices", _SIDES, "float64", "s-1",
             "area inside the separatrix on one side of the saddle",
             "closed integral of phi' over the lobe at h = h_s", FROM_ENERGY),
    Quantity("orbit_kind", "orbits", (), "int8", "1", "kind of the orbit",
             "sign of h - V(phi_s); equilibrium: phi' = 0 and V'(phi) = 0", FROM_ENERGY,
             OrbitKind),
    Quantity("orbit_energy", "orbits", (), "float64", "s-2", "energy of the orbit",
             "h = phi'^2/2 + V(phi)", FROM_ENERGY),
    Quantity("period", "orbits", (), "float64", "s",
             "time of one round, infinite on a separatrix",
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
    Quantity("orbit_family", "action_angle", (), "int8", "1", "family of the orbit",
             "by the centers that a libration goes round, or the sign of phi' of a rotation",
             FROM_ENERGY, OrbitFamily),
    Quantity("angle", "action_angle", (), "float64", "rad",
             "angle variable: 0 at phi_max, of a rotation at the lower center",
             "theta' = 2 pi/T, in [0, 2 pi)", ACTION_ANGLE),
    Quantity("twist", "action_angle", (), "float64", "1",
             "change of the frequency with the action", "d(2 pi/T)/dJ", ACTION_ANGLE),
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
    Quantity("near_center_period", "near_center", _BRANCHES, "float64", "s",
             "period of small oscillations about the center, to first order in the energy",
             "(2 pi/w) (1 + eps (5 V'''^2/(24 w^6) - V''''/(8 w^4))), w^2 = V''", SMALL),
    Quantity("near_center_frequency", "near_center", _BRANCHES, "float64", "s-1",
             "angular frequency of small oscillations, to first order in the energy",
             "w - eps (5 V'''^2/(24 w^5) - V''''/(8 w^3)), w^2 = V''", SMALL),
    Quantity("near_separatrix_period", "near_separatrix", _SADDLES, "float64", "s",
             "period next to the separatrix of the saddle, to leading order in the gap",
             "(n/k) ln(32 k^6/(|gap| |D|)), heteroclinic: (2/k) ln(8 k^4/(|gap| |A|))",
             f"expansion of {FROM_ENERGY}"),
    Quantity("energy_level", "orbit_families", ("family",), "float64", "s-2",
             "energy of the orbit", "h = phi'^2/2 + V(phi)", FROM_ENERGY),
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
             "kinetic part of the reaction on the rotor, the kinetic pressure on the bearing "
             "reversed", "Newton-Euler with phi'' of the motion and without the weight", PRESSURES),
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
             "torque about n1 that moves a massless carrier as it moves", "(n1, dL_O1/dt)",
             "[HedrihVeljovic2013] (2), with the torque that it omits"),
    Quantity("force_component", "bearing_forces", ("bearing", "component"), "float64", "N",
             "component of the kinetic reaction on the rotor, for constant omega1",
             "F_21 n1 + F_22 w2 - F_23 v01 + F_24 R022/|R022|",
             "[HedrihVeljovic2013] after (28), corrected"),
    Quantity("fixed_force", "fixed_bearing_forces", _FIXED, "float64", "N",
             "reaction of the fixed shaft's bearing on the rotor", "F = F_kinetic + F_weight",
             FIXED_PRESSURES),
    Quantity("fixed_force_kinetic", "fixed_bearing_forces", _FIXED, "float64", "N",
             "kinetic part of the fixed shaft's reaction on the rotor, the kinetic pressure on "
             "the bearing reversed", "Newton-Euler with phi'' of the motion and without the weight",
             FIXED_PRESSURES),
    Quantity("fixed_force_weight", "fixed_bearing_forces", _FIXED, "float64", "N",
             "weight part of the fixed shaft's reaction on the rotor", "Newton-Euler at rest",
             FIXED_PRESSURES),
    Quantity("critical_fold", "critical", ("fold",), "float64", "1",
             "value of the parameter at the fold of equilibria",
             "|B|^(2/3) + |C|^(2/3) = |A|^(2/3)", FROM_MOTION),
    Quantity("critical_sign_change", "critical", (), "float64", "1",
             "value of the parameter where A changes sign", "A = 0", FROM_MOTION),
)
# fmt: on


def _at_equilibria(group: str, names: Iterable[str], into: str) -> tuple[Quantity, ...]:
    """Rows of a group that is computed at every equilibrium."""
    return tuple(
        replace(
            row,
            name=f"equilibrium_{row.name}",
            group=into,
            dims=(*_BRANCHES, *row.dims),
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
    *_loads("separatrix_rotators", (*_SIDES, "rotator_name"), *_ROTATOR_LOADS),
    *_loads("separatrix_forces", (*_SIDES, "bearing"), *_FORCE_LOADS),
    *_loads("orbit_rotators", ("rotator_name",), *_ROTATOR_LOADS),
    *_loads("orbit_forces", ("bearing",), *_FORCE_LOADS),
)

QUANTITIES += (
    Quantity("support_speed", "steady_rotations", _BRANCHES, "float64", "s-1",
             "angular velocity of the support in the steady rotation", "p/M11(phi)", ROUTH_OF,
             of=Routhian),
)  # fmt: skip

#: Equilibria of the amended potential, which are steady rotations.
ROUTH: dict[str, dict[str, str]] = {
    "phi": {"long_name": "angle of the disk in a steady rotation",
            "equation": "V' = p^2 M11'/(2 M11^2)"},
    "kind": {"equation": "sign of V_p''"},
    "energy": {"units": "J", "long_name": "amended potential at the equilibrium",
               "equation": "V_p = V + p^2/(2 M11)"},
    "curvature": {"units": "J", "long_name": "curvature of the amended potential",
                  "equation": "V_p''"},
    "natural_frequency": {"equation": "sqrt(V_p''/(M22 - M12^2/M11))"},
    "exponent": {"equation": "sqrt(-V_p''/(M22 - M12^2/M11))"},
    "n_equilibria": {"equation": "zeros of M11^2 V' - p^2 M11'/2"},
}  # fmt: skip
for _words in ROUTH.values():
    _words["source"] = ROUTH_OF

#: What results in any potential say besides, by group: how sure they are.
NUMERICAL_ROWS: dict[str, tuple[Quantity, ...]] = {
    "equilibria": (
        Quantity("complete", "equilibria", (), "bool", "1",
                 "whether it is proved that there are these equilibria and no others",
                 "bounds of V' and V'' over all pieces; disjoint discs; exact isolation of roots",
                 "[MooreKearfottCloud2009]; [Smith1970]"),
    ),
    "separatrices": (
        Quantity("winding_area_error", "separatrices", ("saddle",), "float64", "s-1",
                 "estimated error of the area under one branch", "of its quadrature", FROM_ENERGY),
        Quantity("lobe_area_error", "separatrices", ("saddle", "side"), "float64", "s-1",
                 "estimated error of the area inside the separatrix", "of its quadrature",
                 FROM_ENERGY),
    ),
    "orbits": (
        Quantity("period_error", "orbits", (), "float64", "s",
                 "estimated error of the period", "of its quadrature", FROM_ENERGY),
        Quantity("action_error", "orbits", (), "float64", "s-1",
                 "estimated error of the action", "of its quadrature", FROM_ENERGY),
    ),
    "motion": (
        Quantity("motion_phi_error", "motion", (), "float64", "rad",
                 "estimated error of the angle", "change of the energy, error of the period",
                 FROM_MOTION),
        Quantity("motion_dphi_error", "motion", (), "float64", "s-1",
                 "estimated error of the angular velocity",
                 "change of the energy, error of the period", FROM_MOTION),
    ),
}  # fmt: skip

ROWS: dict[str, Quantity] = {row.name: row for row in QUANTITIES}

#: Among the inputs of a pass: the law, and its parameters.
LAW = "law"

_ABC = ("A", "B", "C")
#: What rotators need of a machine.
DISK = ("beta", "e", "a", "r", "omega1", "g")
_HEAVY = ("beta", "e", "a", "r", "omega1", "m", "g")
_BORNE = (*_HEAVY, "half_span")
_STATE = ("state_phi", "state_dphi")
_LOOPS = ("saddle_phi", "saddle_exponent", "turning_offset", "loop")

_MOVED = (("state_ddphi", "ddphi"), ("domega1", "domega1"))
_FREE = ("beta", "e", "a", "r", "m", "g", "carrier_inertia", "omega1")
_KEPT = (("momentum", "momentum"),)
_NUMERICAL = "phasekit.phase.numerical.functions:"

#: Passes over the cells, those that compute more groups first; `phasekit.cells.dispatch` finds
#: the one for a system. Groups that need an argument of their own (critical: the parameter) have
#: none; their functions make one for the call.
PASSES: tuple[Pass, ...] = (
    Pass("phasekit.phase.exact.separatrices:phase_space", _ABC, ("equilibria", "separatrices")),
    Pass("phasekit.phase.exact.equilibria:equilibria", _ABC, ("equilibria",)),
    Pass("phasekit.phase.exact.separatrices:separatrices", _ABC, ("separatrices",)),
    Pass("phasekit.phase.exact.potential:potential", (*_ABC, "state_phi"), ("potential",)),
    Pass("phasekit.phase.exact.potential:gradient", (*_ABC, "state_phi"), ("potential_gradient",)),
    Pass(
        "phasekit.phase.exact.potential:curvature", (*_ABC, "state_phi"), ("potential_curvature",)
    ),
    Pass(
        "phasekit.phase.exact.potential:energy",
        (*_ABC, "state_phi", "state_dphi"),
        ("energy_integral",),
    ),
    Pass(
        "phasekit.phase.exact.potential:phase_velocity",
        (*_ABC, "state_phi", "state_energy"),
        ("phase_velocity",),
    ),
    Pass(
        "phasekit.phase.exact.action_angle:orbits_with_angles",
        (*_ABC, "state_phi", "state_dphi"),
        ("orbits", "action_angle"),
    ),
    Pass("phasekit.phase.exact.orbits:orbits", (*_ABC, "state_phi", "state_dphi"), ("orbits",)),
    Pass(
        "phasekit.phase.exact.action_angle:state_of_numbers",
        (*_ABC, "state_action", "state_angle", "state_family"),
        ("state_of",),
    ),
    Pass("phasekit.phase.exact.flow:flow", (*_ABC, "state_phi", "state_dphi", "time"), ("motion",)),
    Pass("phasekit.phase.exact.asymptotics:near_center", (*_ABC, "state_excess"), ("near_center",)),
    Pass(
        "phasekit.phase.exact.asymptotics:near_separatrix",
        (*_ABC, "state_gap"),
        ("near_separatrix",),
    ),
    Pass(
        "phasekit.mechanics.rotators:rotators",
        (*DISK, *_STATE),
        ("rotators",),
        optional=_MOVED,
    ),
    Pass(
        "phasekit.mechanics.bearings:bearing_forces",
        (*_BORNE, *_STATE),
        ("bearing_forces",),
        optional=_MOVED,
    ),
    Pass(
        "phasekit.mechanics.bearings:fixed_bearing_forces",
        (*_HEAVY, "rho_b1", *_STATE),
        ("fixed_bearing_forces",),
        optional=_MOVED,
    ),
    Pass(
        "phasekit.loads.functions:equilibrium_rotators", (*DISK, "phi"), ("equilibrium_rotators",)
    ),
    Pass("phasekit.loads.functions:equilibrium_forces", (*_BORNE, "phi"), ("equilibrium_forces",)),
    Pass(
        "phasekit.loads.functions:separatrix_rotators", (*DISK, *_LOOPS), ("separatrix_rotators",)
    ),
    Pass("phasekit.loads.functions:separatrix_forces", (*_BORNE, *_LOOPS), ("separatrix_forces",)),
    Pass("phasekit.loads.functions:orbit_rotators", (*DISK, *_STATE), ("orbit_rotators",)),
    Pass("phasekit.loads.functions:orbit_forces", (*_BORNE, *_STATE), ("orbit_forces",)),
    Pass(
        "phasekit.phase.exact.orbits:orbits_at_energy",
        (*_ABC, "state_energy"),
        ("orbits",),
        options=("center",),
    ),
    Pass(
        "phasekit.phase.exact.orbits:orbits_at_gap",
        (*_ABC, "state_gap"),
        ("orbits",),
        options=("saddle", "side"),
    ),
    Pass(
        "phasekit.phase.exact.flow:separatrix_motion",
        (*_ABC, "time"),
        ("motion",),
        options=("saddle", "side"),
    ),
    # The freely carried disk, at the momentum that it keeps.
    *(
        Pass(f"phasekit.mechanics.steady:{name}", (*_FREE, *more), groups, Routhian, (), _KEPT)
        for name, more, groups in (
            ("steady", (), ("equilibria",)),
            ("support_speed", ("phi",), ("steady_rotations",)),
            ("most", (), ("labels",)),
        )
    ),
    # Any potential, numerically.
    *(
        Pass(_NUMERICAL + name, (LAW, *states), groups, Conservative, options)
        for name, states, groups, options in (
            ("most", (), ("labels",), ()),
            ("phase_space", (), ("equilibria", "separatrices"), ()),
            ("equilibria", (), ("equilibria",), ()),
            ("separatrices", (), ("separatrices",), ()),
            ("potential", ("state_phi",), ("potential",), ()),
            ("gradient", ("state_phi",), ("potential_gradient",), ()),
            ("curvature", ("state_phi",), ("potential_curvature",), ()),
            ("energy", _STATE, ("energy_integral",), ()),
            ("phase_velocity", ("state_phi", "state_energy"), ("phase_velocity",), ()),
            ("orbits", _STATE, ("orbits",), ()),
            ("flow_with_errors", (*_STATE, "time"), ("motion",), ()),
            ("orbits_at_energy", ("state_energy",), ("orbits",), ("center",)),
            ("orbits_at_gap", ("state_gap",), ("orbits",), ("saddle", "side")),
            ("separatrix_motion_with_errors", ("time",), ("motion",), ("saddle", "side")),
        )
    ),
)


def add(row: Quantity, *passes: Pass) -> None:
    """Add a quantity, a group of its own, with the passes that compute it.

    From then on `sweep` and `quantities` have it; so have worker processes, where this is called
    in the module that defines the function.

    Parameters
    ----------
    row : Quantity
        The row.
    *passes : Pass
        Lines that compute its group, one for each rung of the ladder of laws.

    Raises
    ------
    ParameterError
        If its name or group is taken, a dim is unknown, or no pass computes it.

    Examples
    --------
    >>> add(ROWS["phi"], PASSES[0])
    Traceback (most recent call last):
    phasekit.errors.ParameterError: row: got 'phi', wants a name that is not taken
    """
    global QUANTITIES, PASSES
    if row.name in {*ROWS, *LABELS, *STATES}:
        raise bad("row", row.name, "a name that is not taken")
    if row.group in {other.group for other in QUANTITIES}:
        raise bad("row", row.name, f"a group of its own; {row.group!r} is taken")
    for dim in row.dims:
        if dim not in (row.labels or LABELS):
            raise unknown("row: dim", dim, row.labels or LABELS)
    if not passes or any(one.groups != (row.group,) for one in passes):
        groups = [group for one in passes for group in one.groups]
        raise bad("passes", groups, f"one or several that compute the group {row.group!r} alone")
    ROWS[row.name] = row
    QUANTITIES += (row,)
    PASSES += passes


_NO_LISTS = (bytes, Mapping)


def select(of: str | Iterable[str]) -> tuple[Quantity, ...]:
    """Return the rows that `of` names: groups, quantities, or several of either.

    Raises
    ------
    ParameterError
        If a name is unknown or nothing is named.
    """
    offered = quantities()
    try:
        names = (of,) if isinstance(of, str) else () if isinstance(of, _NO_LISTS) else tuple(of)
    except TypeError:
        names = ()
    if not names:
        raise bad("of", of, "a name or a list of names", "pk.quantities() lists them")
    wanted: set[str] = set()
    for name in names:
        row = ROWS.get(name) if isinstance(name, str) else None
        if row is not None and name not in offered:
            raise ParameterError(
                f"of: got {name!r}, which needs an argument of its own; call pk.{row.group}"
            )
        if not isinstance(name, str) or (name not in offered and name not in offered.groups):
            raise unknown("of: the quantity", name, [*offered.groups, *offered])
        wanted.update([name] if name in offered else offered.groups[name])
    return tuple(row for row in QUANTITIES if row.name in wanted)


def plan_passes(rows: Iterable[Quantity], rung: type[Law] = Trigonometric) -> tuple[Pass, ...]:
    """Return the passes that compute the rows on a rung, as few as the table has."""
    missing = {row.group for row in rows}
    chosen: list[Pass] = []
    for candidate in fitting(rung):
        if missing.issuperset(candidate.groups):
            chosen.append(candidate)
            missing.difference_update(candidate.groups)
    for group in sorted(missing):  # its passes compute others as well, which are not wanted
        if pass_of(group, chosen, rung) not in chosen:
            chosen.append(pass_of(group, chosen, rung))
    return tuple(chosen)


def fitting(rung: type[Law]) -> list[Pass]:
    """Return the lines of the table for a rung: of each group the most special ones."""
    able = [one for one in PASSES if issubclass(rung, one.of) and not one.options]
    special = {group: max(len(one.of.__mro__) for one in able if group in one.groups)
               for group in {group for one in able for group in one.groups}}  # fmt: skip
    return [
        one for one in able if all(len(one.of.__mro__) == special[group] for group in one.groups)
    ]


def pass_of(group: str, chosen: Sequence[Pass], rung: type[Law] = Trigonometric) -> Pass:
    """Return the pass for a group: one of those chosen, else the one that computes the least."""
    for candidate in (*chosen, *reversed(fitting(rung))):
        if group in candidate.groups:
            return candidate
    raise KeyError(group)


class Quantities(Mapping[str, Quantity]):
    """The quantities that a sweep offers, by name; prints as a table."""

    def __init__(self) -> None:
        computed = {group for one in PASSES for group in one.groups}
        self._rows = {row.name: row for row in QUANTITIES if row.group in computed}

    @property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """Names of the quantities of each group."""
        names = dict.fromkeys(row.group for row in self._rows.values())
        return {g: tuple(r.name for r in self._rows.values() if r.group == g) for g in names}

    def __getitem__(self, name: str) -> Quantity:
        """Return the row of a quantity."""
        return self._rows[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names."""
        return iter(self._rows)

    def __len__(self) -> int:
        """Return the number of quantities."""
        return len(self._rows)

    def __repr__(self) -> str:
        """Write the table."""
        head = ("quantity", "group", "dims", "units", "meaning")
        table = [
            (row.name, row.group, ", ".join(row.dims), row.units, row.long_name)
            for row in self._rows.values()
        ]
        widths = [max(len(line[i]) for line in [head, *table]) for i in range(4)]
        return "\n".join(
            "  ".join(text.ljust(width) for text, width in zip(line, widths, strict=False))
            + f"  {line[-1]}"
            for line in [head, *table]
        )


def quantities() -> Quantities:
    """List what `sweep(of=...)` takes: quantities and groups of them, with units and meaning.

    Returns
    -------
    Quantities
        A mapping of name to row; a row has ``group``, ``dims``, ``units``, ``long_name``,
        ``equation`` and ``source``. Printed, it is a table.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.quantities()["winding_area"].units
    's-1'
    >>> "figure_eight" in pk.quantities().groups["separatrices"]
    True
    """
    return Quantities()
