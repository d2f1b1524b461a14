"""The disk on a support that is not driven evenly, but turns freely or under torques."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
import xarray as xr

from phasekit.labels.arguments import NumberLike, Value, bad, named_arguments, same, unknown
from phasekit.laws.ladder import Law, Routhian
from phasekit.mechanics.at_momentum import Machines, machines
from phasekit.systems.amended import Amended
from phasekit.systems.disk import GyroRotorDisk
from phasekit.systems.driven_rotor import checked_number
from phasekit.systems.identity import parameter_values, refuse_another
from phasekit.systems.parameter import Parameter
from phasekit.systems.rotor_motions import RotorMotions
from phasekit.systems.system import MODELS

if TYPE_CHECKING:
    from phasekit.systems.problem import Problem


@dataclass(frozen=True, eq=False)
class FreeGyroRotor(RotorMotions):
    """Heavy disk on a support that turns freely about the vertical, or under torques.

    The machine of `GyroRotorDisk` with two degrees of freedom: the support's angular velocity
    omega1 is not prescribed but follows from the motion. As the support's inertia grows, it turns
    ever more evenly, and the disk moves as that of `GyroRotorDisk`.

    Parameters
    ----------
    disk : GyroRotorDisk
        Disk of scalar parameters, its mass among them. Its omega1 is the support's angular velocity
        at the start, unless told otherwise.
    carrier_inertia : float
        The support's own moment of inertia about the vertical axis, kg m^2, >= 0.
    momentum : float, optional
        Angular momentum about the vertical axis in kg m^2/s, at which the machine is a system of
        one degree of freedom, with equilibria (the steady rotations), maps and diagrams; left out,
        that of the support's omega1 with the disk at rest at phi = 0.

    Raises
    ------
    ParameterError
        If the disk has no mass or array parameters, or the inertia is not a number >= 0.

    Notes
    -----
    With ``s = sin phi``, ``c = cos phi`` and moments of inertia at O2,
    ``M11 = Jc + m a^2 + 2 m a e sin beta s + Ju s^2 + Jv c^2``, ``M12 = Jvn c``, ``M22 = Jn``,
    ``V = -m g e sin beta c``. Torques are Q1 on the support and Q2 on the disk by its shaft,
    which reacts on the support.

    Examples
    --------
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0, m=2.0)
    >>> machine = pk.FreeGyroRotor(disk, carrier_inertia=0.02)
    >>> machine.accelerations(phi=0.5, dphi=0.0)
    Accelerations(domega1=..., ddphi=...)
    >>> motion = machine.simulate(0.5, 0.0, [0.0, 1.0])
    >>> end = motion.isel(time=-1)
    >>> state = (end.motion_phi, end.motion_dphi, end.motion_omega1)
    >>> abs(float(machine.energy(*state)) - machine.energy(0.5, 0.0)) < 1e-9
    True
    >>> machine.mass_matrix(0.5).shape
    (2, 2)

    At the momentum that it keeps it is a system of one degree of freedom, with equilibria and maps:

    >>> p = machine.angular_momentum(0.5, 0.0)
    >>> float(machine.amended(p).p) == p
    True
    >>> ds = pk.sweep(machine, momentum=[0.0, p])
    >>> ds.n_equilibria.dims
    ('momentum',)
    >>> ds.isel(momentum=1).phasekit.system() == machine.replace(momentum=p)
    True
    """

    disk: GyroRotorDisk
    carrier_inertia: NumberLike
    momentum: NumberLike | None = None

    declared: ClassVar[tuple[Parameter, ...]] = (
        *(replace(p, optional=p.name == "half_span") for p in GyroRotorDisk.declared),
        Parameter(
            name="carrier_inertia",
            units="kg m2",
            long_name="moment of inertia of the support",
            low=0.0,
        ),
        Parameter(
            name="momentum",
            units="kg m2 s-1",
            long_name="angular momentum about the vertical axis",
            optional=True,
        ),
    )
    rung: ClassVar[type[Law]] = Routhian
    own_units: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("state_energy", "state_gap", "state_excess"), "J"),
        "state_action": "kg m2 s-1",
    }  # fmt: skip

    def __post_init__(self) -> None:
        """Check that it is one machine, with all of its masses."""
        if not isinstance(self.disk, GyroRotorDisk):
            raise bad("disk", self.disk, "a GyroRotorDisk")
        for name, value in self.disk.parameters.items():
            if not isinstance(value, float) and name != "half_span":
                hint = "make one FreeGyroRotor for each disk.replace(...)"
                raise bad(f"disk.{name}", value, "one number", hint)
        if self.disk.m is None:
            raise bad("disk.m", None, "a mass in kg", "use disk.replace(m=...)")
        wants = "a number >= 0 in kg m2"
        inertia = checked_number("carrier_inertia", self.carrier_inertia, wants, low=0.0)
        object.__setattr__(self, "carrier_inertia", inertia)
        if self.momentum is not None:
            wants = "an angular momentum in kg m2 s-1 whose square is finite"
            momentum = checked_number("momentum", self.momentum, wants)
            if not np.isfinite(momentum * momentum):
                raise bad("momentum", momentum, wants)
            object.__setattr__(self, "momentum", momentum)

    @property
    def law(self) -> Law:
        """The law of the disk's angle at the momentum that is kept."""
        if not all(isinstance(value, float) for value in self.parameters.values()):
            return Routhian()  # many machines
        kept: Any = self.momentum
        return self.amended(self.angular_momentum(0.0, 0.0) if kept is None else kept).law

    @property
    def law_of_parameters(self) -> Machines:
        """The law of the disk's angle as a function of the parameters."""
        domains = ((p.name, p.least, p.high) for p in self.declared)
        return machines(tuple(self.parameters), tuple(domains))

    @property
    def parameters(self) -> dict[str, Value]:
        """The parameters of disk and support by name, without those that are None."""
        own = {"carrier_inertia": self.carrier_inertia, "momentum": self.momentum}
        given: dict[str, Any] = {k: v for k, v in own.items() if v is not None}
        return {**self.disk.parameters, **given}

    @classmethod
    def formula_inputs(cls) -> tuple[str, ...]:
        """Names of the parameters on which the equilibria depend."""
        return ("beta", "e", "a", "r", "omega1", "m", "g", "carrier_inertia", "momentum")

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some parameters changed, of the disk or of the support.

        Arrays make axes of maps; a machine with arrays has equilibria, and no single motion.

        Parameters
        ----------
        **changes : float, array_like or xarray.DataArray
            New values by name; ``disk`` for the whole disk.
        """
        names = ["disk", *(parameter.name for parameter in self.declared)]
        for name in changes:
            if name not in names:
                raise unknown(f"parameter of {type(self).__name__}", name, names)
        disk = changes.pop("disk", self.disk)
        own = {n: changes.pop(n, getattr(self, n)) for n in ("carrier_inertia", "momentum")}
        return type(self)._from_parameters(disk.replace(**changes) if changes else disk, own)

    @classmethod
    def from_dataset(cls, ds: xr.Dataset) -> Self:
        """Rebuild the machine from a map, or from any selection of it."""
        refuse_another(ds, cls.__name__)
        values = parameter_values(ds, cls.declared)
        own = {n: values.pop(n, None) for n in ("carrier_inertia", "momentum")}
        return cls._from_parameters(GyroRotorDisk(**values), own)

    @classmethod
    def _from_parameters(cls, disk: GyroRotorDisk, own: dict[str, Any]) -> Self:
        """A machine of parameters some of which may be arrays, cells of a map."""
        declared = {parameter.name: parameter for parameter in cls.declared}
        kept = {k: None if v is None else declared[k].check(v) for k, v in own.items()}
        own_values = (x for x in kept.values() if x is not None)
        if all(isinstance(x, float) for x in (*disk.parameters.values(), *own_values)):
            return cls(disk=disk, **own)
        made = object.__new__(cls)
        for name, value in {"disk": disk, **kept}.items():
            object.__setattr__(made, name, value)
        return made

    def __eq__(self, other: object) -> bool:
        """Whether it is the same machine; NaN equals NaN."""
        if not isinstance(other, FreeGyroRotor):
            return NotImplemented
        mine, theirs = self.parameters, other.parameters
        return list(mine) == list(theirs) and all(same(mine[n], theirs[n]) for n in mine)

    def __hash__(self) -> int:
        """Hash of the parameters; a machine that holds DataArrays has none."""
        return hash((type(self).__name__, self.disk, self.carrier_inertia, self.momentum))

    def driven(
        self,
        torque1: Any = None,
        torque2: Any = None,
        *,
        parameters: Mapping[str, NumberLike] | None = None,
        period: Any = None,
    ) -> Problem:
        """The whole machine under torques: support and disk, four states, at no fixed momentum.

        It goes wherever a `Problem` goes: `flow`, `poincare_section`, `stroboscopic`, `lyapunov`,
        `sweep`, and at constant torques to branches.

        Parameters
        ----------
        torque1, torque2 : float, str, sympy.Expr or callable, optional
            Torques on the support, and on the disk by its shaft, N m: numbers, formulas of t, phi1,
            phi, omega1, dphi and of `parameters`, or functions of (t, phi1, phi, omega1, dphi).
        parameters : mapping of str to float or array_like, optional
            Parameters of the formulas.
        period : str, sympy.Expr or float, optional
            The period in time of the torques.

        Returns
        -------
        Problem
            With the states ``phi1``, ``phi``, ``omega1``, ``dphi``. Motions begin with phi1 = 0 and
            the disk's omega1 unless told otherwise. Where the torques are formulas motions give
            ``motion_domega1``, ``motion_ddphi``, ``motion_torque1``, ``motion_torque2``,
            ``motion_torque_power``, ``motion_mechanical_energy`` and ``motion_angular_momentum``.

        Raises
        ------
        ParameterError
            If a torque is unusable, or a name is one of the machine's.

        Examples
        --------
        >>> import phasekit as pk
        >>> disk = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.05, r=0.1, omega1=6.0, m=2.0)
        >>> machine = pk.FreeGyroRotor(disk, carrier_inertia=0.02)
        >>> motor = machine.driven("pull - slip*omega1", parameters={"pull": 0.5, "slip": 0.05})
        >>> ds = pk.flow(motor, phi=0.5, dphi=0.0, t=[0.0, 1.0])
        >>> lost = ds.motion_torque1 - (0.5 - 0.05 * ds.motion_omega1)
        >>> abs(lost).max().item() < 1e-12
        True
        """
        from phasekit.systems.driven_rotor import driven_problem

        self._machine  # noqa: B018 - of numbers alone
        return driven_problem(self, (torque1, torque2), parameters, period)

    def amended(self, p: float) -> Amended:
        """Reduction to phi alone at an angular momentum that no torque changes.

        Parameters
        ----------
        p : float
            Angular momentum about the vertical axis, kg m^2/s: `angular_momentum` of any state.

        Returns
        -------
        Amended
            Its potential, equilibria and motions at that momentum.

        Raises
        ------
        ParameterError
            If it is not a number, or too large for its square.
        """
        p = checked_number("p", p, "an angular momentum in kg m2 s-1: one finite number")
        if not np.isfinite(p * p):
            raise bad("p", p, "an angular momentum in kg m2 s-1 whose square is finite")
        return Amended(p, self._machine, self._attrs(), self._coords())


FreeGyroRotor.__init__ = named_arguments("FreeGyroRotor", FreeGyroRotor.__init__)  # type: ignore[method-assign]
MODELS["FreeGyroRotor"] = FreeGyroRotor
