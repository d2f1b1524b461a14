"""Compiling beforehand what first calls would compile."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

from phasekit.labels.arguments import bad, call_checked, unknown
from phasekit.numerics import kept
from phasekit.numerics.kernels import KERNELS, QuickForm
from phasekit.numerics.waits import notice, stage


class Warmed(NamedTuple):
    """What was compiled."""

    kernels: int
    """Kernels for kinds of arguments whose finished machine code is there now."""
    folder: str | None
    """Where it is kept, None where no place can be written."""


@call_checked
def warm(subjects: str | Sequence[str] | None = None) -> Warmed:
    """Compile beforehand what first calls would compile: for images, nodes and courses.

    It takes less than a minute, once on a machine. What formulas of your own need beside it is
    compiled when they are first used.

    Parameters
    ----------
    subjects : str or sequence of str, optional
        For what: "equilibria", "motions", "perturbed", "branches", "cycles"; for all of them by
        default.

    Returns
    -------
    Warmed
        How many `kernels` are compiled, and the `folder` where they are kept.

    Raises
    ------
    ParameterError
        If a subject is unknown.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.warm(["equilibria", "motions"]).kernels > 0  # doctest: +SKIP
    True
    """
    given = (subjects,) if isinstance(subjects, str) else JOBS if subjects is None else subjects
    if not isinstance(given, Iterable):
        raise bad("subjects", subjects, f"some of {', '.join(JOBS)}")
    given = tuple(given)
    for name in given:
        if not isinstance(name, str) or name not in JOBS:
            raise unknown("subject", name, JOBS)
    with notice("compiling what first calls need, once on this machine", logged=True):
        for name in given:
            stage(name)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of the answers, which nobody sees
                JOBS[name](importlib.import_module("phasekit"))
            _finish()
    return Warmed(_finish(), next((str(one) for one, n, _ in kept.inventory() if n), None))


def _finish() -> int:
    """Put finished forms in the place of quick ones; return how many there are."""
    count = 0
    for kernel in list(KERNELS):
        for kinds, form in list(kernel.forms.items()):
            if isinstance(form, QuickForm):
                kernel.finish(kinds, make=True)
            count += 1
    return count


def _rotors(pk: Any) -> Any:
    import numpy as np

    beta, a = np.linspace(0.0, 1.5, 60), np.linspace(-0.06, 0.06, 60)
    return pk.GyroRotorDisk(
        beta=beta, e=0.05, a=0.012, r=0.2, omega1=31.4, m=2.0, half_span=0.2, g=9.81
    ), {"beta": beta, "a": a}  # fmt: skip


def _equilibria(pk: Any) -> None:
    disk, axes = _rotors(pk)
    groups = ["equilibria", "separatrices", "separatrix_forces", "separatrix_rotators"]
    pk.sweep(disk.replace(beta=1.0), **axes, of=groups)
    pk.bearing_forces(disk.replace(beta=1.4), phi=[0.3], dphi=[0.2])


def _motions(pk: Any) -> None:
    import numpy as np

    system, times = pk.Coefficients(4.0, 1.0, 0.5), np.linspace(0.0, 20.0, 401)
    starts = np.linspace(-3.0, 3.0, 3000)
    pk.orbits(system, starts, 0.3)
    pk.action_angle(system, starts, 0.3)
    pk.flow(system, starts[::100], 0.3, times)
    pk.orbit_families(system, 50)


def _perturbed(pk: Any) -> None:
    import numpy as np

    damped = pk.Perturbed(pk.Pendulum(length=9.81), damping=0.1)
    driven = damped.replace(forcing=pk.Harmonic(0.5, 0.7))
    pk.capture(damped)
    pk.melnikov(driven)
    pk.flow(driven, np.linspace(-1.0, 1.0, 50), 0.2, np.linspace(0.0, 5.0, 101))
    pk.lyapunov(driven, 0.1, 0.0, duration=200.0)
    pk.basins(driven, phi=np.linspace(-3.0, 3.0, 20), dphi=np.linspace(-2.0, 2.0, 20))


def _neuron(pk: Any) -> Any:
    rates = {"v": "v - v^3/3 - w + current", "w": "eps*(v + 0.7 - 0.8*w)"}
    window = {"v": (-2.5, 2.5), "w": (-1.0, 2.0)}
    return pk.Problem(rates, parameters={"current": 0.2, "eps": 0.08}, window=window)


def _branches(pk: Any) -> None:
    neuron = _neuron(pk)
    branch = pk.continuation(neuron, "current", x0=[-1.2, -0.6], span=(0.0, 2.0))
    branch.special("hopf")[0].curve("eps", span=(0.05, 0.1))
    pk.equilibria(neuron)
    pk.nullclines(neuron)


def _cycles(pk: Any) -> None:
    branch = pk.continuation(_neuron(pk), "current", x0=[-1.2, -0.6], span=(0.0, 2.0))
    family = branch.special("hopf")[0].switch()
    list(family.special_points)


#: What is computed, by its subject: enough cells for all of it to be worth compiling.
JOBS: dict[str, Callable[[Any], None]] = {
    "equilibria": _equilibria,
    "motions": _motions,
    "perturbed": _perturbed,
    "branches": _branches,
    "cycles": _cycles,
}
