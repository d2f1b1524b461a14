"""What is known of one system of one degree of freedom, on whatever rung of the ladder of laws.

Each rung answers by its own methods: the trigonometric law in closed form, any other conservative
one numerically, and motion at constant momenta along its arc length. One system, plain arrays.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from phasekit.arrays import Array
from phasekit.errors import Loop, ParameterError
from phasekit.laws.ladder import Conservative, Law, Routhian, Standing, Trait, is_turn
from phasekit.laws.perturbed import PerturbedLaw
from phasekit.laws.trigonometric import Trigonometric
from phasekit.phase.exact import potential as closed_form
from phasekit.phase.exact.orbits import orbits
from phasekit.phase.exact.phase_space import phase_space
from phasekit.phase.numerical import functions, torqued
from phasekit.phase.numerical.arc_length import ArcLength
from phasekit.phase.numerical.formula import Formula
from phasekit.phase.numerical.inertial import Inertial
from phasekit.phase.numerical.separatrices import separatrices


@dataclass(frozen=True, eq=False)
class Answers:
    """A law with its parameters: energy M(x) x'^2/2 + V(x), equilibria and separatrices.

    Attributes
    ----------
    coordinate : str
        Name of x.
    is_angle : bool
        Whether x is an angle in rad.
    period : float or None
        Length of the circle, None on a line.
    ends : (float, float)
        Where the coordinate lies, infinite on a line.
    units : str
        Unit of V; empty where it may be any.
    phi, kind, energy : numpy.ndarray
        Equilibria that are there, by their coordinate.
    saddle_phi, saddle_energy, loop, turning_offset : numpy.ndarray
        Saddles that are there, the highest first; the offsets have the last axis side.
    potential, inertia : callable
        V and M of arrays.
    orbit : callable
        `Orbits` of a state (x, x').
    momentum : (str, float, str), optional
        Name, value and unit of the momentum that is constant.
    tilt : float
        What V falls by in a turn; where it does, one turn is looked at as a line.
    cut_at : callable, optional
        The same of the turn that begins at another coordinate, where V falls.
    """

    coordinate: str
    is_angle: bool
    period: float | None
    ends: tuple[float, float]
    units: str
    phi: Array
    kind: npt.NDArray[np.int8]
    energy: Array
    saddle_phi: Array
    saddle_energy: Array
    loop: npt.NDArray[np.int8]
    turning_offset: Array
    potential: Callable[[Any], Array]
    orbit: Callable[[float, float], Any]
    inertia: Callable[[Any], Array] = np.ones_like
    momentum: tuple[str, float, str] | None = None
    tilt: float = 0.0
    cut_at: Callable[[float], Answers] | None = None

    @property
    def turn(self) -> float | None:
        """Length of the circle, also of one that is looked at as a line; None on a line."""
        return self.period if self.cut_at is None else self.ends[1] - self.ends[0]


@functools.singledispatch
def answers(law: Law, values: Mapping[str, float]) -> Answers:
    """Return what is known of a law at values of its parameters; the most special rung answers.

    Raises
    ------
    ParameterError
        If the law has more than one degree of freedom, or the values are out of bounds.

    Examples
    --------
    >>> import phasekit as pk
    >>> law = pk.Coefficients.trigonometric()
    >>> answers(law, {"A": 2.0, "B": 1.0, "C": 0.0}).phi.round(3).tolist()
    [-1.047, 0.0, 1.047, 3.142]
    """
    raise ParameterError(f"system: got {law.called}, wants one of one degree of freedom")


@answers.register
def _(law: Trigonometric, values: Mapping[str, float]) -> Answers:
    own = {name: np.asarray(values[name]) for name in law.parameters}
    A, B, C = map(float, law.coefficients(own))
    # No potential spans more than this; its square root is a speed.
    if not np.isfinite(4.0 * abs(A) + 4.0 * abs(B) + 4.0 * abs(C)):
        raise ParameterError(
            f"system: got coefficients {A!r}, {B!r}, {C!r}, wants a potential of finite differences"
        )
    points, loops = phase_space(A, B, C)
    return Answers(
        coordinate=law.coordinate,
        is_angle=True,
        period=law.period,
        ends=(-np.pi, np.pi),
        units="s-2",
        potential=lambda x: closed_form.potential(A, B, C, x),
        orbit=lambda x, v: orbits(A, B, C, x, v),
        **present(points, loops),
    )


@answers.register(Conservative)
def _(law: Formula, values: Mapping[str, float]) -> Answers:
    law.check_searchable()
    own = [values[name] for name in law.names]
    points, loops = functions.phase_space(law, *own)
    return Answers(
        coordinate=law.coordinate,
        is_angle=is_turn(law.period),
        period=law.period,
        ends=law.ends,
        units="s-2" if is_turn(law.period) else "",
        potential=lambda x: law.values(x, *own),
        orbit=lambda x, v: functions.orbits(law, *own, x, v),
        **present(points, loops),
    )


@answers.register
def _(law: PerturbedLaw, values: Mapping[str, float]) -> Answers:
    if not law.standing.is_within(Standing(Conservative, Trait.TORQUED)):
        # At constant momenta a torque keeps an energy, too, but no orbits are known.
        alone = law.traits in Trait.TORQUED
        without = "without a torque" if alone else "whose energy stays"
        raise ParameterError(
            f"system: got {law.called}, wants one {without}, perturbed.system; "
            "pk.plot.damped_portrait draws motions under damping and a torque"
        )
    if not isinstance(law.base, Trigonometric):
        law.check_searchable()
        return _under_torque(law, values)
    A, B, C = map(float, law.coefficients({name: np.asarray(x) for name, x in values.items()}))
    N = values["torque"]
    if N and not np.isfinite(4.0 * (abs(A) + abs(B) + abs(C)) + 4.0 * law.base.period * abs(N)):
        raise ParameterError(
            f"system: got coefficients {A!r}, {B!r}, {C!r} and torque {N!r}, wants a potential of "
            "finite differences"
        )
    return _under_torque(law, values)


def _under_torque(
    law: PerturbedLaw, values: Mapping[str, float], low: float | None = None
) -> Answers:
    """What is known under a torque: of the line, or of the turn that begins at a coordinate.

    On the cylinder the energy of a state is known up to what turns change it by. What leaves the
    picture at one side comes back at the other, on the level that its energy is there.
    """
    base: Any = law.base
    torque, turn = values["torque"], base.period
    if torque == 0.0:
        return answers(base, {name: values[name] for name in law.inputs})
    own = [values[name] for name in law.names]
    points, loops = torqued.phase_space(law, *own)
    places: dict[str, Any] = {}
    if turn is None:
        places["ends"] = base.ends
    else:
        first = -0.5 * turn if low is None else low
        cut_at = functools.partial(_under_torque, law, values)
        places.update(ends=(first, first + turn), tilt=turn * torque, cut_at=cut_at)

        def home(phi: Array, energy: Array) -> tuple[Array, Array]:
            turns = np.ceil((phi - first) / turn) - 1.0
            return phi - turn * turns, energy + turn * torque * turns

        phi, energy = home(points.phi, points.energy)
        saddle_phi, saddle_energy = home(loops.saddle_phi, loops.saddle_energy)
        points = points._replace(phi=phi, energy=energy)
        loops = loops._replace(saddle_phi=saddle_phi, saddle_energy=saddle_energy)
    return Answers(
        coordinate=base.coordinate,
        is_angle=is_turn(turn),
        period=None,
        units="s-2" if is_turn(turn) else "",
        potential=lambda x: torqued.potential(law, *own, x),
        orbit=lambda x, v: torqued.orbits(law, *own, x, v),
        **places,
        **present(points, loops),
    )


@answers.register
def _(law: Routhian, values: Mapping[str, float]) -> Answers:
    path = ArcLength.from_law(law)
    ground = path.ground()
    found = separatrices(ground)
    loops: Any = type(found)(*(field[0] for field in found))
    saddle = loops.saddle_phi[:, np.newaxis]
    own = path.place(loops.saddle_phi)
    offset = path.place(saddle + loops.turning_offset) - own[:, np.newaxis]
    half = 0.5 * law.period
    own = half - (half - own) % law.period
    return Answers(
        coordinate=law.coordinate,
        is_angle=is_turn(law.period),
        period=law.period,
        ends=(-half, half),
        units="J",
        potential=lambda x: np.asarray(law.potential(x)[0]),
        orbit=functools.partial(path.orbit, ground),
        inertia=lambda x: np.asarray(law.inertia(x)[0]),
        momentum=law.momentum,
        **present(law.equilibria(), loops._replace(saddle_phi=own, turning_offset=offset)),
    )


@answers.register
def _(law: Inertial, values: Mapping[str, float]) -> Answers:
    found = answers(law.with_values(values), {})
    return dataclasses.replace(found, units="s-2" if found.is_angle else "")


def present(points: Any, loops: Any) -> dict[str, Any]:
    """Equilibria that are there, by phi, and saddles that are there, the highest first."""
    found: dict[str, Any] = {}
    for part, there, key, names in (
        (points, np.isfinite(points.phi), points.phi, ("phi", "kind", "energy")),
        (loops, loops.loop > Loop.ABSENT, -loops.saddle_energy,
         ("saddle_phi", "saddle_energy", "loop", "turning_offset")),
    ):  # fmt: skip
        order = np.flatnonzero(there)
        order = order[np.argsort(key[order], kind="stable")]
        found.update((name, getattr(part, name)[order]) for name in names)
    return found
