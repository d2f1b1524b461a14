"""What is known of one system under a constant torque, for pictures: one turn, cut open.

On the cylinder the energy of a state is known up to what turns change it by. What leaves the
picture at one side comes back at the other, on the level that its energy is there. On a line the
torque makes another potential.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np

from phasekit.errors import ParameterError
from phasekit.laws.ladder import is_turn
from phasekit.laws.perturbed import TiltedConservative, TiltedTrigonometric
from phasekit.laws.trigonometric import Trigonometric
from phasekit.perturbation import tilted_numerical, tilted_potential
from phasekit.perturbation.tilted import tilted_phase_space
from phasekit.perturbation.tilted_energy import height, tilt
from phasekit.perturbation.tilted_orbits import TURN, orbits
from phasekit.phase.answers import Answers, answers, present


@answers.register
def of_tilted(law: TiltedTrigonometric, values: Mapping[str, float]) -> Answers:
    """Return what is known under a torque; without one, of the system itself."""
    if values["torque"] != 0.0:
        return one_turn(law, values, -np.pi)
    base: Trigonometric = law.base
    return answers(base, {name: values[name] for name in law.inputs})


def one_turn(law: TiltedTrigonometric, values: Mapping[str, float], low: float) -> Answers:
    """Return what is known of the turn that begins at an angle."""
    own = [values[name] for name in law.names]
    A, B, C, N = map(float, tilt(law, *own))
    if not np.isfinite(4.0 * (abs(A) + abs(B) + abs(C)) + 4.0 * TURN * abs(N)):
        raise ParameterError(
            f"system: got coefficients {A!r}, {B!r}, {C!r} and torque {N!r}, wants a potential of "
            "finite differences"
        )
    points, loops = tilted_phase_space(law, *own)

    return Answers(
        coordinate="phi",
        is_angle=True,
        period=None,
        ends=(low, low + TURN),
        units="s-2",
        potential=lambda x: np.asarray(height(x, A, B, C, N)),
        orbit=lambda x, v: orbits(law, *own, x, v),
        tilt=TURN * N,
        cut_at=functools.partial(one_turn, law, values),
        **_seen(points, loops, low, TURN, N),
    )


@answers.register
def of_tilted_potential(law: TiltedConservative, values: Mapping[str, float]) -> Answers:
    """Return what is known of any potential under a torque; without one, of the potential."""
    base: Any = law.base
    if values["torque"] == 0.0:
        return answers(base, {name: values[name] for name in law.inputs})
    law.check_searchable()
    return of_potential(law, values, base.ends[0])


def of_potential(law: TiltedConservative, values: Mapping[str, float], low: float) -> Answers:
    """Return what is known of the line, or of the turn of a circle that begins at a coordinate."""
    base: Any = law.base
    own, torque = [values[name] for name in law.names], values["torque"]
    points, loops = tilted_potential.equilibria(law, *own), tilted_numerical.separatrices(law, *own)
    turn = base.period
    known: dict[str, Any] = {"ends": base.ends, **present(points, loops)}
    if turn is not None:
        known = {
            "ends": (low, low + turn),
            "tilt": turn * torque,
            "cut_at": functools.partial(of_potential, law, values),
            **_seen(points, loops, low, turn, torque),
        }
    return Answers(
        coordinate=base.coordinate,
        is_angle=is_turn(turn),
        period=None,
        units="s-2" if is_turn(turn) else "",
        potential=lambda x: tilted_potential.potential(law, *own, x),
        orbit=lambda x, v: tilted_numerical.orbits(law, *own, x, v),
        **known,
    )


def _seen(points: Any, loops: Any, low: float, turn: float, torque: float) -> dict[str, Any]:
    """Equilibria and saddles of the turn that begins at a coordinate, with their energies there."""

    def home(phi: np.ndarray, energy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turns = np.ceil((phi - low) / turn) - 1.0
        return phi - turn * turns, energy + turn * torque * turns

    phi, energy = home(points.phi, points.energy)
    saddle_phi, saddle_energy = home(loops.saddle_phi, loops.saddle_energy)
    return present(
        points._replace(phi=phi, energy=energy),
        loops._replace(saddle_phi=saddle_phi, saddle_energy=saddle_energy),
    )
