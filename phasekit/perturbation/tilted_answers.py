"""What is known of one system under a constant torque, for pictures: one turn, cut open.

On the cylinder the energy of a state is known up to what turns change it by. What leaves the
picture at one side comes back at the other, on the level that its energy is there.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np

from phasekit.errors import ParameterError
from phasekit.laws.perturbed import TiltedTrigonometric
from phasekit.laws.trigonometric import Trigonometric
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

    def seen(phi: np.ndarray, energy: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        turns = np.ceil((phi - low) / TURN) - 1.0
        return phi - TURN * turns, energy + TURN * N * turns

    phi, energy = seen(points.phi, points.energy)
    saddle_phi, saddle_energy = seen(loops.saddle_phi, loops.saddle_energy)
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
        **present(
            points._replace(phi=phi, energy=energy),
            loops._replace(saddle_phi=saddle_phi, saddle_energy=saddle_energy),
        ),
    )
