"""The accessor ``ds.phasekit``: from any selection of a map to its system and its pictures.

It holds nothing but the Dataset that it was asked of (xarray keeps accessors), and never fails
when it is made.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import xarray as xr

from phasekit.errors import ParameterError
from phasekit.labelled.map_plots import MapPlots as MapPlots
from phasekit.labels.arguments import NumberLike, bad, state_arguments
from phasekit.labels.conversion import in_si, in_units
from phasekit.labels.dask_later import load_dask_later
from phasekit.labels.tables import table_of
from phasekit.maps.described import completeness, described
from phasekit.spellings import Guided
from phasekit.systems.identity import MODEL, model_name
from phasekit.systems.registry import model_named
from phasekit.systems.system import System

if TYPE_CHECKING:
    import pandas as pd

    from phasekit.labelled.continuation.branch import Branch


load_dask_later()


@xr.register_dataset_accessor("phasekit")  # type: ignore[no-untyped-call]
class PhasekitAccessor(Guided):
    """What a map can do beyond plain xarray.

    Examples
    --------
    >>> import phasekit as pk
    >>> ds = pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1, 0.2, 0.3])
    >>> pk.equilibria(ds.sel(lam=0.2).phasekit.system()).n_equilibria.item()
    4
    """

    _guides = ("dataset",)

    def __init__(self, ds: xr.Dataset) -> None:
        self._ds = ds

    def __repr__(self) -> str:
        """Say whose map this is, along what, what it holds and how complete it is."""
        ds = self._ds
        if MODEL not in ds.attrs:
            return f"a Dataset without the attribute {MODEL!r}: not a map that phasekit made"
        return "\n".join([f"map of {ds.attrs[MODEL]}", *described(ds), completeness(ds)])

    def system(self) -> System:
        """Rebuild the system of this map, or of the selected cells.

        Returns
        -------
        System
            The model that made the map; with scalars where single cells are selected, and with
            arrays along the axes that are left.

        Raises
        ------
        ParameterError
            If the Dataset is not a map of phasekit, a parameter's coordinate is gone, or the
            selected cell is not valid.

        Examples
        --------
        >>> import phasekit as pk
        >>> ds = pk.sweep(pk.Reduced(0.1, 0.2), lam=[0.1, 0.2, 0.3])
        >>> ds.sel(lam=0.2).phasekit.system()
        Reduced(lam=0.2, psi=0.2, Omega_sq=1.0)
        """
        return model_named("ds", model_name(self._ds)).from_dataset(self._ds)

    def branch(self, number: int = 0) -> Branch:
        """Follow a branch of one cell of a map of branches again, with all of its points.

        Parameters
        ----------
        number : int, default 0
            Which of its branches, where it has several that do not hang together, or that cross:
            those from equilibria at the lower end of the span come first.

        Returns
        -------
        Branch
            The special points on it are those of the cell.

        Raises
        ------
        ParameterError
            If this is not one cell of a map with ``along=``, or there is no such branch.

        Examples
        --------
        >>> import phasekit as pk
        >>> cusp = pk.Problem("mu + nu*x - x^3", "x", {"mu": 0, "nu": 1}, window={"x": (-3, 3)})
        >>> ds = pk.sweep(cusp, nu=[0.75, 1.0], along=("mu", (-1, 1)), of="special_points")
        >>> branch = ds.isel(nu=0).phasekit.branch()
        >>> [round(fold["mu"], 9) for fold in branch.special("fold")]
        [0.25, -0.25]
        """
        from phasekit.labelled.continuation.cell_branch import cell_branch

        return cell_branch(self._ds, self.system(), number)

    def to(self, units: Mapping[str, str] | None = None, **units_by_name: str) -> xr.Dataset:
        """Return this Dataset with some variables and coordinates in other units.

        Parameters
        ----------
        units : mapping of str to str, optional
            Units by the names of variables or coordinates: ``"deg"``, ``"rpm"``, ``"mm"``, ...
        **units_by_name
            The same by keyword.

        Returns
        -------
        xarray.Dataset
            A copy in which their numbers, and their attributes ``units``, are in those units. What
            phasekit makes of it is the same: systems, loads and pictures read the attributes.

        Raises
        ------
        ParameterError
            If a name or a unit is unknown, a unit is one of something else, or a variable has
            no attribute ``units``.

        Examples
        --------
        >>> import phasekit as pk
        >>> disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=10 * pk.rpm)
        >>> folds = pk.critical(disk, "omega1").phasekit.to(critical_fold="rpm", a="mm")
        >>> folds.critical_fold.attrs["units"], folds.a.item()
        ('rpm', 24.0)
        """
        if units is not None and not isinstance(units, Mapping):
            raise bad("units", units, "a mapping of names to units, {'beta': 'deg'}")
        given = dict(units or {})
        for name in units_by_name:
            if name in given:
                raise ParameterError(f"{name}: got it in units and as a keyword, wants it once")
        return in_units(self._ds, {**given, **units_by_name})

    def table(self, units: Mapping[str, str] | None = None, **units_by_name: str) -> pd.DataFrame:
        """Return a table for reading and for spreadsheets: names for codes, units in the head.

        Parameters
        ----------
        units : mapping of str to str, optional
            Units of some columns, as in `to`.
        **units_by_name
            The same by keyword.

        Returns
        -------
        pandas.DataFrame
            A row for each cell of the dims that most variables have; variables with others are
            left out, and rows of what is absent. States of equilibria have a column each.
            ``.to_csv(path)`` writes it.

        Raises
        ------
        ParameterError
            As `to`.

        Examples
        --------
        >>> import phasekit as pk
        >>> ds = pk.equilibria(pk.Coefficients(2.0, 1.0, 0.0))
        >>> ds.phasekit.table(phi="deg")[["phi (deg)", "kind"]].round(3)
                      phi (deg)    kind
        equilibrium
        lower_center       60.0  center
        lower_saddle        0.0  saddle
        upper_center      -60.0  center
        upper_saddle      180.0  saddle
        """
        return table_of(self.to(units, **units_by_name))

    @state_arguments
    def rotators(
        self,
        on: str = "equilibria",
        *,
        phi0: NumberLike | None = None,
        dphi0: NumberLike | None = None,
        **parameters: NumberLike,
    ) -> xr.Dataset:
        """Vector rotators on the equilibria, separatrices or orbits of this map of disks.

        Parameters
        ----------
        on : {"equilibria", "separatrix", "orbit"}
            Where: at every equilibrium, over the loops of the separatrices, or over the orbits
            through given states.
        phi0, dphi0 : float, 1-D array_like or xarray.DataArray
            With ``on="orbit"``: states, angles in rad and angular velocities in s^-1.
        **parameters
            Parameters that replace those of the map.

        Returns
        -------
        xarray.Dataset
            At equilibria ``rotator`` and ``rotator_intensity``. Else, for each rotator,
            ``peak_intensity``, ``mean_intensity`` and ``rms_intensity`` over the curve in s^-2, and
            ``intensity_peak_phi``, ``intensity_peak_dphi``, where the peak lies: on (``saddle``,
            ``side``) as `bearing_forces` explains. Lazy where the map is.

        Raises
        ------
        ParameterError
            If the map is not one of disks, or an argument is unusable.

        Examples
        --------
        >>> import phasekit as pk
        >>> disk = pk.GyroRotorDisk(beta=0.3, e=0.1, a=0.05, r=0.1, omega1=10.0)
        >>> ds = pk.sweep(disk, beta=[0.1, 0.2])
        >>> ds.phasekit.rotators(on="equilibria").rotator.dims
        ('beta', 'equilibrium', 'rotator_name', 'carrier_axis')
        """
        return self._on_map("rotators", on, phi0, dphi0, parameters)

    @state_arguments
    def bearing_forces(
        self,
        on: str = "equilibria",
        *,
        phi0: NumberLike | None = None,
        dphi0: NumberLike | None = None,
        **parameters: NumberLike,
    ) -> xr.Dataset:
        """Bearing forces on the equilibria, separatrices or orbits of this map of disks.

        Parameters
        ----------
        on : {"equilibria", "separatrix", "orbit"}
            Where: at every equilibrium, over the loops of the separatrices, or over the orbits
            through given states.
        phi0, dphi0 : float, 1-D array_like or xarray.DataArray
            With ``on="orbit"``: states, angles in rad and angular velocities in s^-1.
        **parameters
            Parameters that replace those of the map, or that it lacks: ``m``, ``half_span``.

        Returns
        -------
        xarray.Dataset
            At equilibria ``force`` and its parts as in `phasekit.bearing_forces`. Else, for each
            ``bearing``, ``peak_force``, ``mean_force`` and ``rms_force`` over the curve in N, and
            ``peak_phi``, ``peak_dphi``, where the peak lies. On separatrices these have the dims
            ``saddle`` and ``side``: the lobe on that side of the saddle, there and back; the
            winding loop that leaves to that side; or the arc to the partner saddle, there and back.
            Means are over the angle there (over time both are the saddle's own value), and over
            time on orbits; all is NaN for an orbit that tends to a saddle. Lazy where the map is.

        Raises
        ------
        ParameterError
            If the map is not one of disks with mass and bearings, or an argument is unusable.

        Examples
        --------
        >>> import phasekit as pk
        >>> disk = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=31.4)
        >>> ds = pk.sweep(disk, beta=[0.5, 0.7])
        >>> loads = ds.phasekit.bearing_forces(on="separatrix", m=2.0, half_span=0.2)
        >>> loads.peak_force.dims
        ('beta', 'saddle', 'side', 'bearing')
        """
        return self._on_map("forces", on, phi0, dphi0, parameters)

    def _on_map(self, what: str, on: str, phi0: Any, dphi0: Any, parameters: Any) -> xr.Dataset:
        from phasekit.labelled.loads import on_map

        system = self.system().replace(**parameters)
        return on_map(in_si(self._ds), system, what, on, phi0, dphi0)

    @property
    def plot(self) -> MapPlots:
        """Pictures of this map: see `MapPlots`."""
        return MapPlots(self._ds)
