"""The machine at one angular momentum: its amended potential and steady rotations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from phasekit.docstrings import explained
from phasekit.errors import EquilibriumKind, ParameterError
from phasekit.labels.arguments import bad, numeric, reals
from phasekit.labels.equality import same_fields
from phasekit.labels.grid import variable
from phasekit.labels.units import UNITS_OF
from phasekit.laws.ladder import Lawful, Routhian
from phasekit.mechanics import two_degrees as mechanics
from phasekit.mechanics.at_momentum import AtMomentum
from phasekit.mechanics.two_degrees import TwoDegrees

#: What array functions of the machine take for a state, and return: a number, an array of any
#: shape, or a DataArray.
States = Any

#: What the arguments of methods of the machine are.
WORDS = {
    "phi, dphi": """phi, dphi : float, array_like or xarray.DataArray
    Angle of the disk in rad and its angular velocity in s^-1. Arrays broadcast, DataArrays by the
    names of their dims.""",
    "phi": "phi : float, array_like or xarray.DataArray\n    Angle of the disk in rad.",
    "energy": "energy : float, array_like or xarray.DataArray\n    The level in J.",
    "omega1": """omega1 : float, array_like or xarray.DataArray, optional
    Angular velocity of the support in s^-1; that of the disk's parameters by default.""",
}
SOURCE = "Routh's reduction; [Veljovic2015] (11) with omega1 free, corrected"
STEADY = {
    "phi": ("rad", "angle of the disk in a steady rotation", "V' = p^2 M11'/(2 M11^2)"),
    "kind": ("1", "type of the steady rotation at fixed momentum", "sign of V_p''"),
    "energy": ("J", "energy of the steady rotation", "V_p = V + p^2/(2 M11)"),
    "curvature": ("J", "curvature of the amended potential", "V_p''"),
    "frequency": (
        "s-1",
        "angular frequency of small oscillations at fixed momentum (centers)",
        "sqrt(V_p''/(M22 - M12^2/M11))",
    ),
    "omega1": ("s-1", "angular velocity of the support in a steady rotation", "p/M11"),
}


@explained(WORDS)
@dataclass(frozen=True, eq=False, repr=False)
class Amended(Lawful):
    """The machine at one angular momentum p about the vertical axis: one degree of freedom.

    `FreeGyroRotor.amended` makes it. The energy is
    ``(M22 - M12^2/M11) phi'^2/2 + V_p(phi)`` with the amended potential
    ``V_p = V + p^2/(2 M11)``.

    Examples
    --------
    >>> import phasekit as pk
    >>> disk = pk.GyroRotorDisk(beta=1.0, e=0.1, a=0.0, r=0.1, omega1=15.0, m=2.0)
    >>> amended = pk.FreeGyroRotor(disk, 0.02).amended(0.5)
    >>> amended.equilibria().steady_kind.values.tolist()
    [1, 2, 1, 2]
    >>> top = amended.potential(0.0)  # phi = 0 is a saddle at this momentum
    >>> abs(amended.gradient(0.0)) < 1e-12, amended.curvature(0.0) < 0.0
    (True, True)
    >>> kinetic = 0.5 * amended.effective_inertia(0.3) * amended.phase_velocity(0.3, top) ** 2
    >>> round(kinetic + amended.potential(0.3) - top, 12)
    0.0
    >>> amended.omega1(0.0, 0.0) > 0.0
    True
    """

    rung: ClassVar[type[Routhian]] = Routhian

    p: float
    """Angular momentum about the vertical axis, kg m^2/s."""
    _machine: TwoDegrees
    _attrs: Mapping[str, str]
    _coords: Mapping[str, xr.Variable]

    def __eq__(self, other: object) -> bool:
        """Whether it is the same machine at the same momentum."""
        if type(self) is not type(other):
            return NotImplemented
        return same_fields(self, other)

    def __hash__(self) -> int:
        """Hash of the momentum."""
        return hash(self.p)

    @property
    def law(self) -> Routhian:
        """The law of the disk's angle."""
        return AtMomentum(self._machine, self.p)

    @property
    def parameters(self) -> dict[str, float]:
        """None: the law has them."""
        return {}

    def potential(self, phi: States) -> States:
        """Amended potential V_p in J at angles in rad."""
        return self._potential(0, "amended_potential", "amended potential", phi)

    def gradient(self, phi: States) -> States:
        """First derivative of the amended potential, in J."""
        return self._potential(1, "amended_gradient", "gradient of the amended potential", phi)

    def curvature(self, phi: States) -> States:
        """Second derivative of the amended potential, in J."""
        return self._potential(2, "amended_curvature", "curvature of the amended potential", phi)

    def effective_inertia(self, phi: States) -> States:
        """Inertia ``M22 - M12^2/M11`` of phi alone, in kg m^2."""
        row = "effective_inertia", "kg m2", "inertia of the disk's angle at fixed momentum"
        return result_on_states(
            lambda x: mechanics.effective_inertia(self._machine, x), row, phi=phi
        )

    def omega1(self, phi: States, dphi: States) -> States:
        """Angular velocity ``(p - M12 phi')/M11`` of the support, in s^-1."""
        row = "omega1", "s-1", "angular velocity of the support"
        return result_on_states(
            lambda *state: mechanics.support_velocity(self._machine, self.p, *state), row,
            phi=phi, dphi=dphi,
        )  # fmt: skip

    def phase_velocity(self, phi: States, energy: States) -> States:
        """Angular velocity of the disk at an angle, on the level of an energy in J.

        ``+sqrt(2 (energy - V_p)/(M22 - M12^2/M11))`` in s^-1; NaN where the energy is below V_p.
        """

        def function(angle: Any, level: Any) -> Any:
            kinetic = level - mechanics.amended_potential(self._machine, self.p, angle)[0]
            inertia = mechanics.effective_inertia(self._machine, angle)
            return np.sqrt(np.where(kinetic >= 0.0, 2.0 * kinetic, np.nan) / inertia)

        row = "amended_velocity", "s-1", "angular velocity of the disk at fixed momentum"
        return result_on_states(function, row, phi=phi, energy=energy)

    def equilibria(self) -> xr.Dataset:
        """All steady rotations: the disk stands at an angle, the support turns evenly.

        Returns
        -------
        xarray.Dataset
            On the dim ``steady_rotation``, in the order of the angle: ``steady_phi`` in rad,
            ``steady_kind`` (codes of `EquilibriumKind`: by the sign of the amended potential's
            curvature), ``steady_energy`` and ``steady_curvature`` in J, ``steady_frequency`` in
            s^-1 (of small oscillations about centers at the same momentum, else NaN) and
            ``steady_omega1`` in s^-1. Of length 0 where no torque acts on the disk at any angle.

        Notes
        -----
        The roots of a trigonometric polynomial, all of them: at most ten.
        """
        found = mechanics.relative_equilibria(self._machine, self.p)
        data = {}
        for name, values in found._asdict().items():
            units, long_name, equation = STEADY[name]
            attrs: dict[str, Any] = {
                "long_name": long_name,
                "units": units,
                "equation": equation,
                "source": SOURCE,
            }
            if name == "kind":
                codes = np.array([kind.value for kind in EquilibriumKind], np.int8)
                attrs["flag_values"] = codes
                attrs["flag_meanings"] = " ".join(kind.name.lower() for kind in EquilibriumKind)
            data[f"steady_{name}"] = variable(("steady_rotation",), values, attrs)
        attrs = {"long_name": "angular momentum about the vertical axis", "units": "kg m2 s-1"}
        momentum = variable((), self.p, attrs)
        return xr.Dataset(data, {"momentum": momentum, **self._coords}, dict(self._attrs))

    def _potential(self, order: int, name: str, long_name: str, phi: States) -> States:
        return result_on_states(
            lambda x: mechanics.amended_potential(self._machine, self.p, x)[order],
            (name, "J", long_name), phi=phi,
        )  # fmt: skip

    def __repr__(self) -> str:
        """Write the momentum."""
        return f"Amended(p={self.p!r})"


def result_on_states(
    function: Callable[..., Any], row: tuple[str, str, str], *, dims: tuple[str, ...] = (),
    **states: States,
) -> Any:  # fmt: skip
    """As `on_states`, of a function with one result: its name, units and long name."""
    name, *words = row
    rows = {name: (words[0], words[1])}
    return on_states(lambda *state: (function(*state),), rows, dims=dims, **states)[0]


def on_states(
    function: Callable[..., tuple[Any, ...]],
    rows: Mapping[str, tuple[str, str]],
    *,
    dims: tuple[str, ...] = (),
    **states: States,
) -> tuple[Any, ...]:
    """Apply an array function to states: numbers and arrays broadcast, DataArrays by their dims.

    ``rows`` are units and long name of each result by its name, ``dims`` those of the last axes
    that the function adds.
    """
    kept = {name: _state(name, value) for name, value in states.items()}
    labelled = any(isinstance(value, xr.DataArray) for value in kept.values())
    for name, value in kept.items():
        if labelled and isinstance(value, np.ndarray) and value.ndim > 0:
            raise bad(
                name,
                value,
                "a number or a DataArray, as another argument is a DataArray",
                f"name the dimensions: xr.DataArray({name}, dims=(...))",
            )

    def applied(*arrays: Any) -> Any:
        # Python's own floats would raise on overflow.
        results = function(*(np.asarray(array)[()] for array in arrays))
        return results if len(rows) > 1 else results[0]

    try:
        with np.errstate(all="ignore"):
            results = xr.apply_ufunc(
                applied, *kept.values(), output_core_dims=[dims] * len(rows), join="exact"
            )
    except ParameterError:
        raise
    except ValueError as error:
        shapes = " and ".join(
            f"{name} of {dict(value.sizes) if isinstance(value, xr.DataArray) else np.shape(value)}"
            for name, value in kept.items()
        )
        wants = "shapes that broadcast, and equal coordinates"
        raise ParameterError(f"{', '.join(kept)}: got {shapes}, wants {wants}") from error
    results = results if len(rows) > 1 else (results,)
    if not labelled:
        return tuple(float(x) if np.ndim(x) == 0 else np.asarray(x) for x in results)
    for result, (name, (units, long_name)) in zip(results, rows.items(), strict=True):
        result.name = name
        result.attrs = {"long_name": long_name, "units": units}
    return tuple(results)


def _state(argument: str, value: States) -> float | NDArray[np.float64] | xr.DataArray:
    if isinstance(value, np.ndarray) and value.ndim > 1:
        return reals(argument, value, "numbers")
    kept = numeric(argument, value, UNITS_OF.get(argument, ""))
    return kept.compute() if isinstance(kept, xr.DataArray) else kept
