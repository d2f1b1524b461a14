"""What is said of quantities of a law with terms: equations, units, long names."""

from __future__ import annotations

from phasekit.laws.ladder import Law, Routhian, Trait, is_turn

#: Equations of the motion, of a potential and at a constant momentum.
_MOTION = ("motion_phi", "motion_dphi")
_MOVED = "phi'' + V'(phi; p(t)) = -d phi' - q |phi'| phi' + N + F(t)"
_MOVED_AT_MOMENTUM = "M phi'' + M' phi'^2/2 + V_p' = M22 (-d phi' - q |phi'| phi' + N + F(t))"

#: Equations of the equilibria under a torque, of a potential and at a constant momentum.
_STANDING = {
    "phi": "V'(phi) = torque",
    "energy": "V(phi) - torque phi",
    "n_equilibria": "changes of sign of V' - torque between the zeros of V''",
}
_AMENDED = "V + p^2/(2 M11) - M22 torque phi"
_STEADY = {
    "phi": "V' = p^2 M11'/(2 M11^2) + M22 torque",
    "energy": _AMENDED,
    "n_equilibria": "zeros of M11^2 (V' - M22 torque) - p^2 M11'/2",
}
#: Units of what is an energy or an action where that is not per unit of inertia.
_IN_JOULES = {
    "melnikov_mean": "J",
    "melnikov_amplitude": "J",
    "turnstile_area": "kg m2 s-1",
    "capture_flux": "J",
}
#: Equations of what has a part of the torque in its energy, at a constant momentum.
_ROUTH = {
    "potential": _AMENDED,
    "potential_gradient": "V' - p^2 M11'/(2 M11^2) - M22 torque",
    "energy_integral": f"h = (M22 - M12^2/M11) phi'^2/2 + {_AMENDED}",
    "phase_velocity": f"phi' = sqrt(2 (h - ({_AMENDED}))/(M22 - M12^2/M11))",
}
#: The same in any potential.
_LEVELS = {
    "topology": "by what the separatrices of all saddles do",
    "figure_eight": "V - torque phi = h_s on both sides of a saddle, before a saddle as high",
    "saddle_phi": "V'(phi_s) = torque, V''(phi_s) < 0",
    "saddle_energy": "h_s = V(phi_s) - torque phi_s",
    "loop": "where V - torque phi = h_s again on either side of the saddle",
    "turning_phi": "V(phi_t) - torque phi_t = h_s",
    "orbit_kind": "sign of h - h_s; equilibrium: phi' = 0 and V'(phi) = torque",
    "orbit_energy": "h = phi'^2/2 + V(phi) - torque phi",
    "phi_min": "V(phi_min) - torque phi_min = h",
    "phi_max": "V(phi_max) - torque phi_max = h",
}
_V = "-B cos(phi) + (A/2) cos(phi)^2 - C sin(phi) - torque phi"
#: The same in the potential of (A, B, C).
_TRIGONOMETRIC = {
    "potential": f"V = {_V}",
    "potential_gradient": "V' = B sin(phi) - A sin(phi) cos(phi) - C cos(phi) - torque",
    "energy_integral": f"h = phi'^2/2 + ({_V})",
    "orbit_energy": f"h = phi'^2/2 + ({_V})",
    "phase_velocity": "phi' = sqrt(2 (h - V(phi) + torque phi))",
    "motion_phi": "phi'' = -V'(phi) + torque",
    "motion_dphi": "phi'' = -V'(phi) + torque",
}


def words_of(base: Law, traits: Trait, unit: str, row: tuple[str, str, str]) -> dict[str, str]:
    """What is said of a row, its name, units and long name, of a base with terms.

    The unit is that of the amplitude of the first harmonic.
    """
    name, units, long_name = row
    words = dict(base.words(name, units, long_name))
    at_momentum = isinstance(base, Routhian)
    if Trait.TORQUED in traits:
        rest = _STEADY if at_momentum else _STANDING
        words |= {"equation": rest[name]} if name in rest else {}
    if name in _MOTION:
        words["equation"] = _MOVED_AT_MOMENTUM if at_momentum else _MOVED
    if at_momentum:
        words |= {"units": _IN_JOULES[name]} if name in _IN_JOULES else {}
    elif name == "chaos_threshold" and unit != units:
        words["units"] = unit
    if traits not in Trait.TORQUED:
        return words
    if at_momentum:
        return words | ({"equation": _ROUTH[name]} if name in _ROUTH else {})
    equations = {**_LEVELS, **_of_base(base, words)}
    words |= {"equation": equations[name]} if name in equations else {}
    told = words.get("long_name", long_name)
    return words | (
        {"long_name": f"{told}, infinite where it runs"} if "NaN for a rotation" in told else {}
    )


def _of_base(base: Law, words: dict[str, str]) -> dict[str, str]:
    """Equations under a torque alone that depend on the potential and its circle."""
    if base.labels_fixed:
        return _TRIGONOMETRIC
    x, period = base.coordinate, base.period  # type: ignore[attr-defined]
    turn = "2 pi" if is_turn(period) else f"{period:g}" if period is not None else ""
    return {
        "potential": f"{words.get('equation', 'V')} - torque {x}",
        "potential_gradient": "V' - torque",
        "energy_integral": f"h = {x}'^2/2 + V - torque {x}",
        "phase_velocity": f"{x}' = sqrt(2 (h - V + torque {x}))",
        "energy_per_turn": f"{turn} torque" if turn else "no turn on a line",
        "gain_per_turn": f"{turn} |torque|" if turn else "no turn on a line",
    }
