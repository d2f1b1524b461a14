"""What is computed of any potential, numerically: passes, and rows that say how sure they are."""

from __future__ import annotations

from phasekit.laws.ladder import Conservative
from phasekit.table.row import (
    BRANCHES,
    DIRECTION,
    FROM_ENERGY,
    FROM_MOTION,
    LAW,
    SIDES,
    STATE,
    Pass,
    Quantity,
)

_NUMERICAL = "phasekit.phase.numerical.functions:"
EXTREMES = "[MooreKearfottCloud2009]"

#: What results in any potential say besides, by group: how sure they are.
NUMERICAL_ROWS: dict[str, tuple[Quantity, ...]] = {
    "equilibria": (
        Quantity("complete", "equilibria", (), "bool", "1",
                 "whether these are proved to be all equilibria",
                 "bounds of V' and V'' over all pieces; disjoint discs; exact isolation of roots",
                 "[MooreKearfottCloud2009]; [Smith1970]"),
        Quantity("phi_error", "equilibria", BRANCHES, "float64", "rad",
                 "bound of the error of the angle",
                 "bounds of V' over |V''|; the nearest points at which the sign of V' is known",
                 "[MooreKearfottCloud2009]"),
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
        Quantity("phi_min_error", "orbits", (), "float64", "rad",
                 "bound of the error of the least angle, NaN for a rotation",
                 "the nearest points at which the sign of V - h is known", FROM_ENERGY),
        Quantity("phi_max_error", "orbits", (), "float64", "rad",
                 "bound of the error of the greatest angle, NaN for a rotation",
                 "the nearest points at which the sign of V - h is known", FROM_ENERGY),
    ),
    "critical_torques": (
        Quantity("critical_torque_error", "critical_torques", DIRECTION, "float64", "s-2",
                 "estimated error of the critical torque", "rounding of V'", EXTREMES),
        Quantity("critical_phi_error", "critical_torques", DIRECTION, "float64", "rad",
                 "bound of the error of the angle at which equilibria merge",
                 "bounds of V'' over the third derivative", EXTREMES),
        Quantity("critical_complete", "critical_torques", (), "bool", "1",
                 "whether these are proved to be the extremes", "all zeros of V''", EXTREMES),
    ),
    "quiet_frequencies": (
        Quantity("quiet_frequency_error", "quiet_frequencies", (*SIDES, "order"), "float64", "s-1",
                 "estimated error of the frequency", "rounding of the response over its slope",
                 FROM_ENERGY),
    ),
    "state_of": (
        Quantity("phi_of_angle_error", "state_of", (), "float64", "rad",
                 "estimated error of the angle", "errors of the action and of the motion",
                 FROM_ENERGY),
        Quantity("dphi_of_angle_error", "state_of", (), "float64", "s-1",
                 "estimated error of the angular velocity",
                 "errors of the action and of the motion", FROM_ENERGY),
    ),
    "action_angle": (
        Quantity("orbit_family", "action_angle", (), "int64", "1", "family of the orbit, by code",
                 "sum of 2^k over the numbers k of the centers inside; -1 forward, -2 backward",
                 FROM_ENERGY, of=Conservative),
        Quantity("angle_error", "action_angle", (), "float64", "rad",
                 "estimated error of the angle variable", "distance between the orbit and its "
                 "reconstruction",
                 FROM_ENERGY),
    ),
    "motion": (
        Quantity("motion_phi_error", "motion", (), "float64", "rad",
                 "estimated error of the angle",
                 "rounding of each step, carried along by linear motions; error of the period",
                 FROM_MOTION, of=Conservative),
        Quantity("motion_dphi_error", "motion", (), "float64", "s-1",
                 "estimated error of the angular velocity",
                 "rounding of each step, carried along by linear motions; error of the period",
                 FROM_MOTION, of=Conservative),
    ),
}  # fmt: skip

PASSES: tuple[Pass, ...] = (
    *(
        Pass(_NUMERICAL + name, (LAW, *states), groups, Conservative, options)
        for name, states, groups, options in (
            ("phase_space", (), ("equilibria", "separatrices"), ()),
            ("equilibria", (), ("equilibria",), ()),
            ("potential", ("state_phi",), ("potential",), ()),
            ("gradient", ("state_phi",), ("potential_gradient",), ()),
            ("curvature", ("state_phi",), ("potential_curvature",), ()),
            ("energy", STATE, ("energy_integral",), ()),
            ("phase_velocity", ("state_phi", "state_energy"), ("phase_velocity",), ()),
            ("orbits", STATE, ("orbits",), ()),
            ("angles", STATE, ("action_angle",), ()),
            ("state_of", ("state_action", "state_angle", "state_family"), ("state_of",), ()),
            ("flow_with_errors", (*STATE, "time"), ("motion",), ()),
            ("orbits_at_energy", ("state_energy",), ("orbits",), ("center",)),
            ("orbits_at_gap", ("state_gap",), ("orbits",), ("saddle", "side")),
            ("separatrix_motion_with_errors", ("time",), ("motion",), ("saddle", "side")),
        )
    ),
    Pass(
        "phasekit.phase.numerical.inflections:critical_torque",
        (LAW,),
        ("critical_torques",),
        Conservative,
    ),
    Pass(
        "phasekit.phase.numerical.asymptotics:near_center",
        (LAW, "state_excess"),
        ("near_center",),
        Conservative,
    ),
)
