"""Coordinates of results beside parameters: labels of dims, and the states that are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

#: Labels of a dim, names or numbers, and its long name.
Labels: TypeAlias = tuple[Sequence[Any], str]

#: Label coordinates: dim -> (labels, long_name).
LABELS: dict[str, Labels] = {
    "equilibrium": (
        ("lower_center", "lower_saddle", "upper_center", "upper_saddle"),
        "branch of equilibria",
    ),
    "saddle": (("lower", "upper"), "saddle, by its energy"),
    "side": (("left", "right"), "side of the saddle"),
    "fold": (("minus", "plus"), "fold with A < 0, fold with A > 0"),
    "rotator_name": (
        ("R01", "R011", "R022", "R012", "R1", "R2", "R12", "R12c"),
        "vector rotator",
    ),
    "carrier_axis": (("u01", "v01", "n1"), "axis of the carrier: along n2, [n1, n2], n1"),
    "disk_axis": (("u2", "v2", "n2"), "axis turning with the disk: tangential, radial, along n2"),
    "bearing": (("A2", "B2"), "bearing of the shaft: spherical at +half_span, cylindrical"),
    "fixed_bearing": (("A1", "B1"), "bearing of the fixed shaft: spherical at O1, cylindrical"),
    "component": (("F21", "F22", "F23", "F24"), "component along n1, w2, -v01, and R022"),
    "exponent": ((1, 2), "Lyapunov exponent, the largest first"),
    "crossing": ((), "crossing of the section"),
    "attractor": ((), "attractor, by its number"),
    "region": (("left", "right", "none"), "region: lobe of the lower saddle, or neither"),
    "order": ((1,), "order of the resonance"),
    "direction": (("minus", "plus"), "direction of the torque"),
    "family": (("lower_well", "upper_well", "outer", "rotation"), "family of orbits"),
}

#: States, which quantities may need beside the parameters: name -> (units, long_name).
STATES: dict[str, tuple[str, str]] = {
    "state_phi": ("rad", "angle of the state"),
    "state_dphi": ("s-1", "angular velocity of the state"),
    "state_ddphi": ("s-2", "angular acceleration of the state"),
    "domega1": ("s-2", "angular acceleration of the support"),
    "rho_b1": ("m", "position of the bearing B1 on the fixed shaft, from O1"),
    "state_energy": ("s-2", "energy of the state"),
    "state_gap": ("s-2", "energy of the state above the saddle"),
    "state_excess": ("s-2", "energy of the state above the center"),
    "state_action": ("s-1", "action of the state"),
    "state_angle": ("rad", "angle variable of the state"),
    "state_family": ("1", "family of the state's orbit, by its code"),
    "time": ("s", "time"),
    "box_phi": ("rad", "half of the width in angle of the box of states around rest at 0"),
    "box_dphi": ("s-1", "half of the height in angular velocity of the box of states"),
    "level": ("1", "position of the orbit in its family, by energy from 0 to 1"),
}

#: States whose bare arrays make an axis, where those of the others pair on the dim `point`.
AXES = ("time", "level")
