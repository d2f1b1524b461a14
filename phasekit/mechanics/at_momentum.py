"""The angle of the disk on a free support, at one momentum: the rotor's Routhian.

Of one machine, and of many by their parameters.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from phasekit.errors import EquilibriumKind
from phasekit.inputs import FloatArray
from phasekit.laws.ladder import Routhian, Routhians
from phasekit.mechanics.two_degrees import (
    RelativeEquilibria,
    TwoDegrees,
    amended_potential,
    effective_inertia,
    relative_equilibria,
    support_inertia,
    two_degrees,
)

#: A trigonometric polynomial of degree five has at most so many zeros.
MOST = 10


class Steady(NamedTuple):
    """Equilibria of the amended potential on the last axis, by angle; NaN beyond the last."""

    phi: FloatArray
    kind: npt.NDArray[np.int8]
    energy: FloatArray
    curvature: FloatArray
    natural_frequency: FloatArray
    exponent: FloatArray
    n_equilibria: npt.NDArray[np.int8]


def steady_at(machines: TwoDegrees, p: npt.ArrayLike, torque: npt.ArrayLike = 0.0) -> Steady:
    """Equilibria of V_p = V + p^2/(2 M11) at momenta p, under torques on the shaft in N m.

    All broadcast; energies and curvatures are in J. What is not finite has n_equilibria -1.

    >>> machine = two_degrees(1.0, 0.1, 0.0, 0.1, 2.0, 0.02)
    >>> [int(steady_at(machine, 0.5, torque).n_equilibria) for torque in (0.0, 5.0)]
    [4, 0]
    """
    arrays = np.broadcast_arrays(*machines, p, torque)
    shape = arrays[0].shape
    *fields, momenta, torques = (np.asarray(x, float).reshape(-1) for x in arrays)
    with np.errstate(all="ignore"):
        usable = np.isfinite(momenta * momenta) & np.isfinite(sum(fields)) & np.isfinite(torques)
    size = momenta.size
    columns = np.full((5, size, MOST), np.nan)
    kind = np.full((size, MOST), EquilibriumKind.NOT_COMPUTED, np.int8)
    count = np.full(size, -1, np.int8)
    for i in np.flatnonzero(usable):
        one = TwoDegrees(*(float(x[i]) for x in fields))
        with np.errstate(all="ignore"):
            one_has = relative_equilibria(one, float(momenta[i]), float(torques[i]))
            n = count[i] = one_has.phi.size
            kind[i, :n], kind[i, n:] = one_has.kind, EquilibriumKind.ABSENT
            saddle = one_has.kind == EquilibriumKind.SADDLE
            fall = np.where(saddle, -one_has.curvature, np.nan)
            exponent = np.sqrt(fall / effective_inertia(one, one_has.phi))
            rows = (*one_has[:1], *one_has[2:5], exponent)
            columns[:, i, :n] = rows
    n = max(int(count.max(initial=0)), 0)
    found = columns[:, :, :n].reshape(5, *shape, n)
    phi, energy, curvature, frequency, exponents = found
    kinds, counts = kind[:, :n].reshape(*shape, n), count.reshape(shape)
    return Steady(phi, kinds, energy, curvature, frequency, exponents, counts)


def support_speed(
    beta: npt.ArrayLike,
    e: npt.ArrayLike,
    a: npt.ArrayLike,
    r: npt.ArrayLike,
    m: npt.ArrayLike,
    g: npt.ArrayLike,
    carrier_inertia: npt.ArrayLike,
    omega1: npt.ArrayLike,
    phi: npt.ArrayLike,
    *,
    momentum: npt.ArrayLike | None = None,
) -> FloatArray:
    """Angular velocity p/M11 of the support in steady rotations at phi, on the last axis, s^-1.

    >>> support_speed(1.0, 0.1, 0.0, 0.1, 2.0, 9.81, 0.02, 15.0, [0.0]).round(9)
    array([15.])
    """
    with np.errstate(all="ignore"):
        machine = two_degrees(beta, e, a, r, m, carrier_inertia, g)
        lever = np.asarray(support_inertia(machine, 0.0)[0])
        p = np.asarray(omega1 * lever if momentum is None else momentum)
        spread = TwoDegrees(*(np.asarray(x)[..., None] for x in machine))
        return np.asarray(p[..., None] / support_inertia(spread, np.asarray(phi))[0])


#: What the motion of the disk's angle depends on: the machine, and its momentum.
CONSTANTS = (*TwoDegrees._fields, "p")


@dataclass(frozen=True)
class AtMomentum(Routhian):
    """A machine of two degrees of freedom at the momentum p about n1, kg m^2/s.

    Energies are in J, the inertia in kg m^2.
    """

    coordinate = "phi"
    period = 2.0 * math.pi

    machine: TwoDegrees
    p: float

    @property
    def momentum(self) -> tuple[str, float, str]:  # type: ignore[override]
        """The momentum p."""
        return "p", self.p, "kg m2 s-1"

    @property
    def own_inertia(self) -> Any:
        """M22, kg m^2."""
        return self.machine.Jn

    def potential(self, x: Any) -> tuple[Any, Any, Any]:
        """Amended potential and its first two derivatives, J."""
        return amended_potential(self.machine, self.p, x)

    def inertia(self, x: Any) -> tuple[Any, Any]:
        """M22 - M12^2/M11 and its derivative, kg m^2."""
        m11, slope, _ = support_inertia(self.machine, x)
        m12 = self.machine.Jvn * np.cos(x)
        ratio = m12 / m11
        change = 2.0 * ratio * self.machine.Jvn * np.sin(x) + ratio**2 * slope
        return effective_inertia(self.machine, x), change

    def equilibria(self) -> RelativeEquilibria:
        """All steady rotations at this momentum."""
        return relative_equilibria(self.machine, self.p)


@dataclass(frozen=True)
class Machines(Routhians):
    """The same of machines by their parameters, which may be arrays."""

    coordinate = "phi"
    period = 2.0 * math.pi

    #: All parameters, in the order of the values.
    names: tuple[str, ...]
    #: Parameter -> its least and greatest value.
    domains: Mapping[str, tuple[float, float]] = field(compare=False)

    def values(self, *arrays: Any) -> dict[str, Any]:
        """Values by name, as arrays; NaN where they leave their domain."""
        found = {}
        for name, x in zip(self.names, arrays, strict=True):
            low, high = self.domains[name]
            value = np.asarray(x, float)
            inside = np.isfinite(value) & (value >= low) & (value <= high)
            found[name] = value if inside.all() else np.where(inside, value, np.nan)
        return found

    constants = CONSTANTS

    def alone(self, constants: tuple[float, ...]) -> AtMomentum:
        """The machine of some constants."""
        return AtMomentum(TwoDegrees(*constants[:-1]), constants[-1])

    def resting(self, values: Mapping[str, Any], torque: Any = None) -> Steady:
        """All steady rotations, under a torque on the shaft over M22."""
        one = self.with_values(values)
        push = 0.0 if torque is None else torque * one.machine.Jn
        return steady_at(one.machine, one.p, push)

    def constants_of(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The constants of the parameters."""
        one = self.with_values(values)
        return {**one.machine._asdict(), "p": one.p}

    def with_values(self, values: Mapping[str, Any]) -> AtMomentum:
        """The machines of some values, at the momentum that they keep."""
        v = {name: np.asarray(values[name], float) for name in self.names if name in values}
        with np.errstate(all="ignore"):
            machine = two_degrees(
                v["beta"], v["e"], v["a"], v["r"], v["m"], v["carrier_inertia"], v["g"]
            )
            p: Any = (
                v["momentum"] if "momentum" in v else v["omega1"] * support_inertia(machine, 0.0)[0]
            )
        return AtMomentum(machine, p)

    def resting_formula(self, symbols: Mapping[str, Any]) -> Any:
        """A function of phi with the equilibria as its stationary points, of parameters as symbols.

        Its slope is M11^2 times that of the amended potential, ``M11^2 V' - p^2 M11'/2``, a
        polynomial of sine and cosine; it need not close on the circle.
        """
        import sympy as sp

        c = constants_formulas(symbols)
        phi, sine, cosine = symbols["phi"], sp.sin(symbols["phi"]), sp.cos(symbols["phi"])
        flat, one = c["rest"] + c["tilt"] + c["m"] * c["a"] ** 2, 2 * c["m"] * c["a"] * c["offset"]
        two = c["m"] * c["offset"] ** 2 - c["tilt"]  # M11 = flat + one sine + two sine^2
        powers = [phi, -cosine]  # integrals of the powers of the sine
        for k in range(2, 6):
            powers.append((k - 1) * powers[k - 2] / k - sine ** (k - 1) * cosine / k)
        square = (flat**2, 2 * flat * one, one**2 + 2 * flat * two, 2 * one * two, two**2)
        lifted = sum(part * powers[k + 1] for k, part in enumerate(square))
        return c["weight"] * lifted - c["p"] ** 2 / 2 * (one * sine + two * sine**2)

    def acceleration_formula(self, symbols: Mapping[str, Any], rate: Any, push: Any) -> Any:
        """The acceleration, of constants or parameters as symbols; push is a torque over M22.

        From Lagrange's equations with omega1 = (p - M12 phi')/M11.
        """
        c = symbols if CONSTANTS[0] in symbols else {**symbols, **constants_formulas(symbols)}
        m11, m12, half_slope, sine = _parts(c, symbols["phi"])
        omega1 = (c["p"] - m12 * rate) / m11
        right1 = c["Jvn"] * sine * rate**2 - 2 * half_slope * omega1 * rate
        right2 = c["Jn"] * push + half_slope * omega1**2 - c["weight"] * sine
        return (m11 * right2 - m12 * right1) / (m11 * c["Jn"] - m12**2)


def _parts(c: Mapping[str, Any], phi: Any) -> tuple[Any, Any, Any, Any]:
    """M11, M12, half the slope of M11, and the sine of the angle, as formulas."""
    import sympy as sp

    sine, cosine = sp.sin(phi), sp.cos(phi)
    reach = c["a"] + c["offset"] * sine
    m11 = c["rest"] + c["tilt"] * cosine**2 + c["m"] * reach**2
    half_slope = cosine * (c["m"] * c["offset"] * reach - c["tilt"] * sine)
    return m11, c["Jvn"] * cosine, half_slope, sine


def lagrange_formulas(symbols: Mapping[str, Any], torques: tuple[Any, Any]) -> dict[str, Any]:
    """Accelerations, energy and momentum of support and disk under torques, as formulas.

    Symbols are those of the parameters and of phi, omega1 and dphi; torques act on the support and
    on the disk by its shaft, in N m. Lagrange's equations, without a constant momentum.
    """
    import sympy as sp

    c = constants_formulas({**symbols, "momentum": 0})
    speed, rate = symbols["omega1"], symbols["dphi"]
    m11, m12, half_slope, sine = _parts(c, symbols["phi"])
    right1 = torques[0] + c["Jvn"] * sine * rate**2 - 2 * half_slope * speed * rate
    right2 = torques[1] + half_slope * speed**2 - c["weight"] * sine
    scale = m11 * c["Jn"] - m12**2
    kinetic = (m11 * speed**2 + 2 * m12 * speed * rate + c["Jn"] * rate**2) / 2
    return {
        "domega1": (c["Jn"] * right1 - m12 * right2) / scale,
        "ddphi": (m11 * right2 - m12 * right1) / scale,
        "mechanical_energy": kinetic - c["weight"] * sp.cos(symbols["phi"]),
        "angular_momentum": m11 * speed + m12 * rate,
        "torque_power": torques[0] * speed + torques[1] * rate,
    }


def constants_formulas(symbols: Mapping[str, Any]) -> dict[str, Any]:
    """The constants as formulas of the parameters: `two_degrees` in symbols."""
    import sympy as sp

    sine, cosine = sp.sin(symbols["beta"]), sp.cos(symbols["beta"])
    m, e, a = (symbols[name] for name in ("m", "e", "a"))
    J = m * symbols["r"] ** 2 / 4
    turned = J + m * e**2
    found = {
        "rest": symbols["carrier_inertia"] + J + m * (e * cosine) ** 2,
        "tilt": J * cosine**2,
        "m": m,
        "a": a,
        "offset": e * sine,
        "Jn": J + turned * sine**2,
        "Jvn": turned * sine * cosine,
        "weight": m * symbols["g"] * e * sine,
    }
    rest = found["rest"] + found["tilt"] + m * a**2
    return {
        **found,
        "p": symbols["momentum"] if "momentum" in symbols else symbols["omega1"] * rest,
    }


@functools.cache
def machines(names: tuple[str, ...], domains: tuple[tuple[str, float, float], ...]) -> Machines:
    """The law of machines by their parameters, one for equal names."""
    return Machines(names, {name: (low, high) for name, low, high in domains})
