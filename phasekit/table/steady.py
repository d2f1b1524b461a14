"""Rows of the freely carried disk: steady rotations, at the momentum that it keeps."""

from __future__ import annotations

from phasekit.laws.ladder import Routhian
from phasekit.table.row import BRANCHES, LAW, STATE, Pass, Quantity

ROUTH_OF = "Routh's reduction; [Veljovic2015] (11) with omega1 free, corrected"

_FREE = ("beta", "e", "a", "r", "m", "g", "carrier_inertia", "omega1")
_KEPT = (("momentum", "momentum"),)

# fmt: off
QUANTITIES: tuple[Quantity, ...] = (
    Quantity("support_speed", "steady_rotations", BRANCHES, "float64", "s-1",
             "angular velocity of the support in the steady rotation", "p/M11(phi)", ROUTH_OF,
             of=Routhian),
)
# fmt: on

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
    "potential": {"units": "J", "long_name": "amended potential", "equation": "V + p^2/(2 M11)"},
    "potential_gradient": {"units": "J", "long_name": "gradient of the amended potential",
                           "equation": "V' - p^2 M11'/(2 M11^2)"},
    "potential_curvature": {"units": "J", "long_name": "curvature of the amended potential",
                            "equation": "V_p''"},
    "energy_integral": {"units": "J", "long_name": "energy at the momentum",
                        "equation": "(M22 - M12^2/M11) phi'^2/2 + V_p"},
    "phase_velocity": {"equation": "sqrt(2 (h - V_p)/(M22 - M12^2/M11))"},
    "saddle_energy": {"units": "J", "equation": "h_s = V_p(phi_s)"},
    "saddle_exponent": {"equation": "sqrt(-V_p''/(M22 - M12^2/M11))"},
    "winding_area": {"units": "kg m2 s-1", "equation": "int M phi' dphi, M = M22 - M12^2/M11"},
    "lobe_area": {"units": "kg m2 s-1", "equation": "oint M phi' dphi, M = M22 - M12^2/M11"},
    "winding_area_error": {"units": "kg m2 s-1"},
    "lobe_area_error": {"units": "kg m2 s-1"},
    "turning_phi": {"equation": "V_p(phi_t) = h_s"},
    "orbit_energy": {"units": "J", "equation": "h = M phi'^2/2 + V_p, M = M22 - M12^2/M11"},
    "period": {"equation": "oint dphi/phi'"},
    "action": {"units": "kg m2 s-1", "equation": "oint M phi' dphi/(2 pi)"},
    "action_error": {"units": "kg m2 s-1"},
    "phi_min": {"equation": "V_p(phi_min) = h"},
    "phi_max": {"equation": "V_p(phi_max) = h"},
    "near_center_period": {
        "equation": "(2 pi/w) (1 + eps (5 V_sss^2/(24 w^6) - V_ssss/(8 w^4))), w^2 = V_ss, V = V_p,"
                    " ds = sqrt(M22 - M12^2/M11) dphi"},
    "near_center_frequency": {
        "equation": "w - eps (5 V_sss^2/(24 w^5) - V_ssss/(8 w^3)), w^2 = V_ss, V = V_p,"
                    " ds = sqrt(M22 - M12^2/M11) dphi"},
    "motion_phi": {"equation": "M phi'' + M' phi'^2/2 + V_p' = 0, M = M22 - M12^2/M11"},
    "motion_dphi": {"equation": "M phi'' + M' phi'^2/2 + V_p' = 0, M = M22 - M12^2/M11"},
}  # fmt: skip
for _words in ROUTH.values():
    _words["source"] = ROUTH_OF

_MACHINES = "phasekit.phase.numerical.machines:"

PASSES: tuple[Pass, ...] = (
    *(
        Pass(_MACHINES + name, (LAW, *states), (group,), Routhian, options)
        for name, states, group, options in (
            ("separatrices", (), "separatrices", ()),
            ("orbits", STATE, "orbits", ()),
            ("near_center", ("state_excess",), "near_center", ()),
            ("orbits_at_energy", ("state_energy",), "orbits", ("center",)),
            ("orbits_at_gap", ("state_gap",), "orbits", ("saddle", "side")),
            ("angles", STATE, "action_angle", ()),
            ("state_of", ("state_action", "state_angle", "state_family"), "state_of", ()),
            ("separatrix_motion_with_errors", ("time",), "motion", ("saddle", "side")),
        )
    ),
    Pass(_MACHINES + "equilibria", (LAW,), ("equilibria",), Routhian),
    Pass(
        "phasekit.mechanics.at_momentum:support_speed",
        (*_FREE, "phi"),
        ("steady_rotations",),
        Routhian,
        (),
        _KEPT,
    ),
)
