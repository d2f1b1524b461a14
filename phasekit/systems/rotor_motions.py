"""The disk on a free support: motions in time, sections, and what it has in given states."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from phasekit.docstrings import explained
from phasekit.errors import ParameterError
from phasekit.labels.arguments import FloatArray, NumberLike, bad, describe, numeric, whole
from phasekit.labels.grid import variable
from phasekit.labels.units import UNITS_OF
from phasekit.mechanics import two_degrees as mechanics
from phasekit.mechanics.two_degrees import TwoDegrees
from phasekit.motion.sections import passages, strobe
from phasekit.motion.steps import InitialValue
from phasekit.systems.amended import WORDS, States, on_states, result_on_states
from phasekit.systems.disk import GyroRotorDisk
from phasekit.systems.driven_rotor import (
    CAUSES,
    DERIVED,
    LAGRANGE,
    STATE,
    DrivenRotor,
    StateFunction,
    Torque,
    checked_number,
    checked_torque,
    event_of,
)
from phasekit.systems.identity import MODEL, SCHEMA, SCHEMA_VERSION, versions
from phasekit.systems.system import System
from phasekit.systems.trajectory import Labels, Trajectory, trajectory

#: Most states that a section may have.
MOST = 10_000_000


class Accelerations(NamedTuple):
    """Angular accelerations of support and disk, s^-2."""

    domega1: Any
    ddphi: Any


@explained(WORDS, raises="ParameterError\n    If an argument is unusable, or shapes do not fit.")
class RotorMotions(System):
    """What `FreeGyroRotor` does in time, and has in states, where its parameters are numbers."""

    disk: GyroRotorDisk
    carrier_inertia: NumberLike

    def simulate(
        self,
        phi0: float,
        dphi0: float,
        t: NumberLike,
        *,
        omega1: float | None = None,
        phi1: float = 0.0,
        torque1: Torque = None,
        torque2: Torque = None,
        rtol: float = 1e-11,
        atol: float = 1e-12,
        max_step: float = np.inf,
    ) -> xr.Dataset:
        """Motion from a state, integrated in time.

        Parameters
        ----------
        phi0, dphi0 : float
            Angle of the disk in rad and its angular velocity in s^-1 at the first of the times.
        t : 1-D array_like or (start, stop)
            Times in s at which the motion is wanted, rising or falling. Of two, the result has the
            steps of the integrator between them.
        omega1, phi1 : float, optional
            Angular velocity in s^-1 and angle in rad of the support at the first of the times; the
            disk's omega1, and 0.
        torque1, torque2 : float or callable, optional
            Torques on the support, and on the disk by its shaft, N m: numbers, or functions of
            (t, phi1, phi, omega1, dphi).
        rtol, atol : float
            Error of a step, relative and absolute, that the integrator (DOP853) allows.
        max_step : float
            Longest step, s. Give one if a torque acts in pulses shorter than the motion's own time.

        Returns
        -------
        xarray.Dataset
            On the dim ``time``: ``motion_phi1``, ``motion_phi`` in rad (continuous: they run past
            pi), ``motion_omega1``, ``motion_dphi`` in s^-1, ``domega1``, ``ddphi`` in s^-2,
            ``torque1``, ``torque2`` in N m, ``torque_power`` in W, ``mechanical_energy`` in J and
            ``angular_momentum`` in kg m^2/s.

        Raises
        ------
        ParameterError
            If an argument is unusable.
        ConvergenceError
            If the integrator cannot reach the end with the accuracy asked for.

        See Also
        --------
        FreeGyroRotor.trajectory : the motion as a function of time, with events.

        Notes
        -----
        Bearing forces along a motion: ``pk.bearing_forces(disk, ds)``.

        Examples
        --------
        >>> import phasekit as pk
        >>> disk = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0, m=2.0)
        >>> machine = pk.FreeGyroRotor(disk, carrier_inertia=0.02)
        >>> motion = machine.simulate(0.5, 0.0, [0.0, 1.0, 2.0], torque1=0.1)
        >>> motion.angular_momentum.diff("time").values.round(9)
        array([0.1, 0.1])
        """
        times = _times(t)
        found = self.trajectory(
            phi0,
            dphi0,
            (float(times[0]), float(times[-1])),
            omega1=omega1,
            phi1=phi1,
            torque1=torque1,
            torque2=torque2,
            rtol=rtol,
            atol=atol,
            max_step=max_step,
        )
        return found(found.steps if times.size == 2 else times)

    def trajectory(
        self,
        phi0: float,
        dphi0: float,
        span: tuple[float, float],
        *,
        omega1: float | None = None,
        phi1: float = 0.0,
        torque1: Torque = None,
        torque2: Torque = None,
        events: StateFunction | Mapping[str, StateFunction] | None = None,
        rtol: float = 1e-11,
        atol: float = 1e-12,
        max_step: float = np.inf,
    ) -> Trajectory:
        """Motion from a state as a function of time, with events.

        Parameters
        ----------
        span : (float, float)
            Time of the initial state and time to go to, s; either may be the larger one.
        events : callable or mapping of str to callable, optional
            Functions of (t, phi1, phi, omega1, dphi), with names of your choice; times are found
            at which they vanish. As in SciPy, an attribute ``terminal = True`` of the function
            ends the motion there, and ``direction`` of 1 or -1 selects where it rises or falls.
            One that comes to 1e-8 of its values around and turns back touches zero and counts,
            unless it has a direction. Zeros closer together than a quarter of a step may be
            missed: `max_step` makes steps shorter.
        phi0, dphi0, omega1, phi1, torque1, torque2, rtol, atol, max_step
            As `simulate`.

        Returns
        -------
        Trajectory
            Called with times it gives what `simulate` does; ``.events`` is a Dataset on the dim
            ``event``; ``.start``, ``.stop`` and ``.steps`` are times.

        Raises
        ------
        ParameterError
            If an argument is unusable.
        ConvergenceError
            If the integrator cannot reach the end with the accuracy asked for.

        Examples
        --------
        >>> import phasekit as pk
        >>> disk = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0, m=2.0)
        >>> machine = pk.FreeGyroRotor(disk, carrier_inertia=0.02)
        >>> motion = machine.trajectory(
        ...     0.5, 0.0, (0.0, 2.0), events={"turns": lambda t, phi1, phi, omega1, dphi: dphi}
        ... )
        >>> abs(motion(motion.events.event_time[1].item()).motion_dphi.item()) < 1e-9
        True
        """
        start, stop = _times(span, two=True)
        if isinstance(events, Mapping):
            named: Mapping[str, StateFunction] = events
        else:
            named = {} if events is None else {"event": events}
        watched = {name: event_of(name, event) for name, event in named.items()}
        state = (phi1, phi0, omega1, dphi0)
        torques = (torque1, torque2)
        labels, problem = self._motion(state, torques, float(start), rtol, atol, max_step)
        return trajectory(labels, problem, float(stop), watched)

    def poincare(
        self,
        phi0: float,
        dphi0: float,
        duration: float,
        *,
        period: float | None = None,
        section: float | None = None,
        direction: int = 1,
        omega1: float | None = None,
        phi1: float = 0.0,
        torque1: Torque = None,
        torque2: Torque = None,
        rtol: float = 1e-11,
        atol: float = 1e-12,
        max_step: float = np.inf,
    ) -> xr.Dataset:
        """Poincare section of one motion, from time 0 on.

        Parameters
        ----------
        duration : float
            Time to integrate, s.
        period : float, optional
            Take the states at 0, period, 2 period, ...: of a torque that repeats itself.
        section : float, optional
            Take the states in which the disk passes this angle (rad, full turns aside). Exactly
            one of `period` and `section` is given.
        direction : {1, -1, 0}
            With `section`: passages with rising phi, falling phi, or both.
        phi0, dphi0, omega1, phi1, torque1, torque2, rtol, atol, max_step
            As `simulate`; the state is that at time 0.

        Returns
        -------
        xarray.Dataset
            On the dim ``crossing``: ``section_time`` in s, ``section_phi1``, ``section_phi`` in
            rad in (-pi, pi], ``section_omega1`` and ``section_dphi`` in s^-1.

        Raises
        ------
        ParameterError
            If an argument is unusable.
        ConvergenceError
            If the integrator cannot reach the end with the accuracy asked for.

        Notes
        -----
        Without a torque on the support, states of equal energy and momentum lie on one curve. With
        a torque that depends on phi1, a spring say, or on time, they need not.

        Examples
        --------
        >>> import phasekit as pk
        >>> disk = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0, m=2.0)
        >>> machine = pk.FreeGyroRotor(disk, carrier_inertia=0.02)
        >>> ds = machine.poincare(
        ...     0.5, 0.0, 5.0, section=0.6, torque1=lambda t, phi1, phi, omega1, dphi: -phi1
        ... )
        >>> bool((ds.section_dphi > 0).all())
        True
        """
        wants = "a time in s, > 0"
        duration = checked_number("duration", duration, wants, low=np.nextafter(0, 1))
        if (period is None) == (section is None):
            raise ParameterError(
                f"period, section: got {describe(period)} and {describe(section)}, wants exactly "
                "one of them: the period of a torque in s, or an angle of the disk in rad"
            )
        senses = "1 (rising), -1 (falling) or 0 (both)"
        direction = whole("direction", direction, senses, -1)
        if direction > 1:
            raise bad("direction", direction, senses)
        state = (phi1, phi0, omega1, dphi0)
        torques = (torque1, torque2)
        labels, problem = self._motion(state, torques, 0.0, rtol, atol, max_step)
        if period is not None:
            period = checked_number("period", period, wants, low=np.nextafter(0, 1))
            if period > duration:
                raise bad("period", period, f"at most the duration, {duration!r} s")
            if duration / period > MOST:
                raise bad("period", period, f"at least the duration over {MOST:.0e}")
            found = strobe(problem, period * np.arange(np.floor(duration / period) + 1))
        else:
            angle = checked_number("section", section, "an angle in rad: one finite number")
            turn = 2.0 * np.pi
            found = passages(problem, duration, 1, angle, period=turn, direction=direction)
        found.state[:2] = np.pi - np.mod(np.pi - found.state[:2], 2.0 * np.pi)
        return labels.section(found, "phi = section")

    def accelerations(
        self,
        phi: States,
        dphi: States,
        omega1: States | None = None,
        *,
        torque1: States = 0.0,
        torque2: States = 0.0,
    ) -> Accelerations:
        """Accelerations of support and disk in states.

        Parameters
        ----------
        torque1, torque2 : float, array_like or xarray.DataArray
            Torques on the support and on the disk by its shaft, N m.

        Returns
        -------
        Accelerations
            domega1 and ddphi in s^-2; numbers, arrays or DataArrays as the states.

        Notes
        -----
        Lagrange's equations; for a prescribed omega1 the second one is [Veljovic2015] (11),
        corrected, with the term of omega1' that is missing there.

        Examples
        --------
        >>> import phasekit as pk
        >>> pendulum = pk.GyroRotorDisk(beta=90 * pk.deg, e=0.5, a=0, r=0, omega1=0, m=1, g=9.81)
        >>> round(pk.FreeGyroRotor(pendulum, 1.0).accelerations(30 * pk.deg, 0.0).ddphi, 12)
        -9.81
        """
        rows = {
            "domega1": ("s-2", "angular acceleration of the support"),
            "ddphi": ("s-2", "angular acceleration of the disk"),
        }
        states = {"phi": phi, "dphi": dphi, "omega1": self._omega1(omega1)}
        return Accelerations(
            *on_states(
                functools.partial(mechanics.accelerations, self._machine),
                rows,
                **states,
                torque1=torque1,
                torque2=torque2,
            )
        )

    def mass_matrix(self, phi: States) -> States:
        """Matrix [[M11, M12], [M12, M22]] of the kinetic energy, kg m^2.

        It multiplies (omega1', phi''). The last two axes, for a DataArray the dims ``row`` and
        ``column``, are those of the matrix.

        Returns
        -------
        ndarray or xarray.DataArray
            Shape (..., 2, 2).
        """
        row = "mass_matrix", "kg m2", "mass matrix of support and disk"
        function = functools.partial(mechanics.mass_matrix, self._machine)
        return result_on_states(function, row, dims=("row", "column"), phi=phi)

    def energy(self, phi: States, dphi: States, omega1: States | None = None) -> States:
        """Kinetic and potential energy, J; constant without torques.

        The potential energy of the weight is 0 at ``phi = pi/2``.
        """
        row = "mechanical_energy", "J", "kinetic and potential energy"
        function = functools.partial(mechanics.energy, self._machine)
        return result_on_states(function, row, phi=phi, dphi=dphi, omega1=self._omega1(omega1))

    def angular_momentum(self, phi: States, dphi: States, omega1: States | None = None) -> States:
        """Angular momentum ``M11 omega1 + M12 phi'`` about the vertical axis, kg m^2/s.

        Its rate is the torque on the support: it is constant without one.
        """
        row = "angular_momentum", "kg m2 s-1", "angular momentum about the vertical axis"
        function = functools.partial(mechanics.angular_momentum, self._machine)
        return result_on_states(function, row, phi=phi, dphi=dphi, omega1=self._omega1(omega1))

    def _motion(
        self,
        state: tuple[Any, ...],
        torques: tuple[Torque, Torque],
        start: float,
        rtol: float,
        atol: float,
        max_step: float,
    ) -> tuple[Labels, InitialValue]:
        """Check what an integration is given."""
        units = {"phi1": "rad", "phi0": "rad", "omega1": "s-1", "dphi0": "s-1"}
        initial: Any = tuple(
            checked_number(
                name, self._omega1(x) if name == "omega1" else x, f"one number in {unit}"
            )
            for (name, unit), x in zip(units.items(), state, strict=True)
        )
        # DOP853 itself goes no lower than this
        least = 100 * np.finfo(float).eps
        rtol = checked_number("rtol", rtol, f"a number >= {least:.3g}", low=least)
        atol = checked_number("atol", atol, "a number >= 0", low=0.0)
        if not (isinstance(max_step, float) and max_step == np.inf):
            wants = "a time in s, > 0"
            max_step = checked_number("max_step", max_step, wants, low=np.nextafter(0, 1))
        torque1, torque2 = (
            checked_torque(name, value, start, initial)
            for name, value in zip(("torque1", "torque2"), torques, strict=True)
        )
        driven = DrivenRotor(self._machine, torque1, torque2)
        driven.check(start, initial)
        texts = (LAGRANGE, self._attrs(), self._coords())
        labels = Labels(STATE, DERIVED, driven.derived, *texts)
        problem = InitialValue(
            driven.rates, initial, start, rtol=rtol, atol=atol, max_step=max_step, causes=CAUSES
        )
        return labels, problem

    @functools.cached_property
    def _machine(self) -> TwoDegrees:
        d: Any = self.disk
        for name, value in self.parameters.items():
            if not isinstance(value, float) and name != "half_span":
                hint = "select one cell: ds.isel(...).phasekit.system()"
                raise bad(name, value, "one number, for a single motion", hint)
        return mechanics.two_degrees(d.beta, d.e, d.a, d.r, d.m, self.carrier_inertia, d.g)

    def _omega1(self, omega1: States | None) -> States:
        return self.disk.omega1 if omega1 is None else omega1

    def _attrs(self) -> dict[str, str]:
        return {MODEL: type(self).__name__, SCHEMA: SCHEMA_VERSION, **versions()}

    def _coords(self) -> dict[str, xr.Variable]:
        """Parameters as scalar coordinates; omega1 is a state here."""
        units = {p.name: {"long_name": p.long_name, "units": p.units} for p in self.disk.declared}
        values: dict[str, Any] = {
            name: value
            for name, value in self.disk.parameters.items()
            if name not in ("omega1", "half_span")
        }
        coords = {name: variable((), value, units[name]) for name, value in values.items()}
        attrs = {"long_name": "moment of inertia of the support", "units": "kg m2"}
        return {**coords, "carrier_inertia": variable((), self.carrier_inertia, attrs)}


def _times(t: Any, *, two: bool = False) -> FloatArray:
    argument = "span" if two else "t"
    wants = "(start, stop), two times in s" if two else "two times in s, (start, stop), or more"
    kept = numeric(argument, t, UNITS_OF[argument], wants)
    times = np.asarray(kept.values if isinstance(kept, xr.DataArray) else kept)
    if times.ndim != 1 or times.size < 2 or (two and times.size > 2):
        raise bad(argument, t, wants)
    steps = np.diff(times)
    if not np.isfinite(times).all() or not ((steps > 0).all() or (steps < 0).all()):
        raise bad(argument, t, f"{wants}: finite, and rising or falling throughout")
    return times
