"""Any potential of one coordinate as a system: a formula, its parameters, a line or a circle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, Self

import numpy as np
from numpy.typing import ArrayLike

from phasekit.labels.arguments import (
    FloatArray,
    NumberLike,
    Value,
    bad,
    named_arguments,
    numeric,
    same,
    unknown,
)
from phasekit.labels.coordinates import STATES
from phasekit.laws.ladder import Conservative
from phasekit.phase.numerical.formula import Formula, check_period, make_formula
from phasekit.spellings import refused
from phasekit.systems import potential_parts as parts
from phasekit.systems.parameter import Parameter
from phasekit.systems.statement import TAKEN
from phasekit.systems.system import MODELS, System
from phasekit.table.quantities import ROWS

if TYPE_CHECKING:
    from phasekit.systems.problem import Problem


class Potential(System):
    """Any system of one degree of freedom, ``x'' = -V'(x)``, by its potential.

    Goes wherever a `GyroRotorDisk` goes but for what is in closed form: potential and energy,
    equilibria, separatrices, orbits, flow, portraits and sweeps, by numerical methods. Where
    results call the coordinate phi, it is the coordinate of this system; they have it by its own
    name as well (``x`` beside ``phi``, ``motion_dx`` beside ``motion_dphi``), and so do calls:
    ``pk.orbits(well, x=1.2, dx=0.0)``.

    Parameters
    ----------
    expression : str or sympy expression
        The potential V per unit of inertia. In a string ``^`` and ``**`` both raise to a power,
        and functions have sympy's names; special functions are those of SciPy. Strings are read
        as formulas and nothing else, so that one from another's file can do no harm.
    coordinate : str or sympy symbol
        The coordinate in it.
    parameters : mapping of str to float, 1-D array_like or xarray.DataArray, optional
        Values of the other symbols. An array is an axis of its own name, as in other systems.
    period : float or str, optional
        Length of the circle on which the coordinate lies, 2 pi for an angle (``"2*pi"`` as well);
        None for a line.
    interval : (float, float), optional
        The part of a line that is looked at. Needed for equilibria and all that follows from them
        if V is not a polynomial; orbits that leave it count as unbounded.

    Raises
    ------
    ParameterError
        If the expression cannot be read, a symbol has no value, or V does not repeat over the
        period.

    Notes
    -----
    Equilibria are proved, not sampled: those of polynomials and of finite Fourier sums over the
    period by disjoint discs about the roots of companion matrices ([Boyd2013], [Smith1970]) or by
    exact isolation of roots, those of any other function in the interval, or on the circle, by
    interval arithmetic [MooreKearfottCloud2009]. The interval is closed: an equilibrium at one of
    its ends, or within rounding of it, counts. They are numbered from left to right, from 0; on a
    circle from -period/2. Equilibria that have merged within rounding are one, degenerate. The
    variable ``complete`` of results is False where it is not proved that there are no others: where
    some have merged, where rounding hides V', and for functions of which no bounds are known; what
    was not excluded, and stands for no equilibrium, is named in a RuntimeWarning.

    The variable ``phi_error`` bounds how far a place may be from that of V as written, by bounds of
    V' there, or by the nearest points at which its sign is known where equilibria all but merge.
    Periods, actions, areas and motions come with estimates of their errors (``period_error`` and so
    on). A period, an action or an area whose error may exceed 1e-8 of it is NaN, and a
    RuntimeWarning says how many and why. The errors hold what rounding of V does next to saddles,
    where periods follow the last digits of the energy: there ``gap`` in place of a state, or of an
    energy, keeps them. What does not depend on the coordinate is in no difference of V, so that a
    constant changes energies alone.

    Examples
    --------
    The figure-eight of the double well:

    >>> import phasekit as pk
    >>> well = Potential("x^4/4 - mu*x^2/2", "x", {"mu": 1.0})
    >>> pk.equilibria(well).phi.values
    array([-1.,  0.,  1.])
    >>> pk.separatrices(well).lobe_area.values
    array([[1.33333333, 1.33333333]])
    >>> well.potential([1.0]), well.gradient([2.0]), well.curvature([1.0])
    (array([-0.25]), array([6.]), array([2.]))
    >>> well.problem()
    Problem(x' = dx, dx' = mu*x - x**3; mu=1.0, conservative)

    A pendulum with a second harmonic, for two of its strengths:

    >>> V = Potential("-cos(q) + b*cos(2*q)", "q", {"b": [0.1, 0.5]}, period=6.283185307179586)
    >>> pk.equilibria(V).n_equilibria.values
    array([2, 4], dtype=int16)
    """

    declared: ClassVar[tuple[Parameter, ...]] = ()
    rung: ClassVar[type[Conservative]] = Conservative

    formula: Formula
    _values: dict[str, Value]

    def __init__(
        self,
        expression: Any,
        coordinate: Any,
        parameters: Mapping[str, NumberLike] | None = None,
        period: float | str | None = None,
        *,
        interval: Sequence[float] | None = None,
    ) -> None:
        name = parts.name("coordinate", coordinate)
        if parameters is not None and not isinstance(parameters, Mapping):
            raise bad("parameters", parameters, "a mapping of names to values, {'mu': 1.0}")
        given = {parts.name("parameters", key): value for key, value in (parameters or {}).items()}
        for key in given:
            if key == name:
                raise bad("parameters", key, "names other than the coordinate's")
            if key in TAKEN or key in ROWS:  # rows may have been added
                raise bad("parameters", key, f"another name, because results have {key!r}")
        declared = tuple(
            Parameter(name=key, units="1", long_name=f"parameter {key} of the potential")
            for key in given
        )
        values = {p.name: p.check(numeric(p.name, given[p.name], None)) for p in declared}
        formula = make_formula(
            parts.expression(expression),
            name,
            tuple(given),
            parts.period(period),
            parts.interval(interval, period),
        )
        check_period(formula, tuple(values.values()))
        for key, value in (("declared", declared), ("_values", values), ("formula", formula)):
            object.__setattr__(self, key, value)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        """Refuse: a system does not change."""
        raise AttributeError(f"a Potential is frozen; use .replace({name}=...)")

    def __getattr__(self, name: str) -> Any:
        """Return the value of a parameter."""
        values = self.__dict__.get("_values", {})
        if name not in values:
            return refused(self, name)
        return values[name]

    @property
    def expression(self) -> Any:
        """The potential as a sympy expression, its doubles as the fractions that they are."""
        return self.formula.expression

    @property
    def coordinate(self) -> str:
        """Name of the coordinate."""
        return self.formula.coordinate

    @property
    def period(self) -> float | None:
        """Length of the circle, None on a line."""
        return self.formula.period

    @property
    def interval(self) -> tuple[float, float] | None:
        """The interval of the line that is searched."""
        return self.formula.interval

    @property
    def parameters(self) -> dict[str, Value]:
        """The parameters by name."""
        return dict(self._values)

    @property
    def law(self) -> Conservative:
        """The formula."""
        return self.formula

    def potential(self, x: ArrayLike) -> FloatArray:
        """V at x; `phasekit.potential` labels it.

        Parameters
        ----------
        x : float or array_like
            Values of the coordinate.

        Returns
        -------
        ndarray
            Of the shape of x, per unit of inertia.

        Raises
        ------
        ParameterError
            If a parameter is an array.
        """
        return self.formula.values(x, *self._scalars())

    def gradient(self, x: ArrayLike) -> FloatArray:
        """V' at x; `phasekit.gradient` labels it.

        Parameters
        ----------
        x : float or array_like
            Values of the coordinate.

        Returns
        -------
        ndarray
            Of the shape of x.
        """
        return self.formula.slopes(x, *self._scalars())

    def curvature(self, x: ArrayLike) -> FloatArray:
        """V'' at x; `phasekit.curvature` labels it.

        Parameters
        ----------
        x : float or array_like
            Values of the coordinate.

        Returns
        -------
        ndarray
            Of the shape of x.
        """
        return self.formula.bends(x, *self._scalars())

    def problem(self) -> Problem:
        """The planar system of (x, x') for `continuation`: its equilibria, orbits and loops.

        Returns
        -------
        Problem

        Raises
        ------
        ParameterError
            If a parameter is an array.
        """
        from phasekit.systems.problem import Problem

        values = dict(zip(self._values, self._scalars(), strict=True))
        return Problem.from_potential(
            self.formula.text, self.coordinate, values, period=self.period
        )

    def _scalars(self) -> list[float]:
        values = []
        for name, value in self._values.items():
            if not isinstance(value, float):
                raise bad(name, value, "a scalar", "for arrays use pk.potential, pk.gradient, ...")
            values.append(value)
        return values

    def formula_inputs(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of the parameters: all of them."""
        return tuple(self._values)

    def replace(self, **changes: Any) -> Self:
        """Return a copy with some parameters changed, or expression, period or interval."""
        own = {n: getattr(self, n) for n in ("expression", "coordinate", "period", "interval")}
        values = {**self._values, **{k: v for k, v in changes.items() if k not in own}}
        own.update({key: value for key, value in changes.items() if key in own})
        if own["expression"] is self.expression:
            for name in values:
                if name not in self._values:
                    raise unknown("parameter of Potential", name, [*self._values, *own])
        return type(self)(parameters=values, **own)

    def unit_of(self, name: str) -> str | None:
        """Only times have a known unit; V may be one of anything."""
        return STATES[name][0] if name == "time" else None

    @property
    def arguments(self) -> dict[str, Any]:
        """The keyword arguments that rebuild it."""
        return {
            "expression": self.formula.text,
            "coordinate": self.coordinate,
            "parameters": self.parameters,
            "period": self.period,
            "interval": self.interval,
        }

    @property
    def definition(self) -> dict[str, str]:
        """What maps store beside the parameters' values."""
        return {
            "phasekit_expression": self.formula.text,
            "phasekit_coordinate": self.coordinate,
            "phasekit_parameters": " ".join(self.formula.names),
            "phasekit_period": repr(self.period),
            "phasekit_interval": " ".join(map(repr, self.interval or ())),
        }

    @classmethod
    def from_dataset(cls, ds: Any) -> Self:
        """Rebuild the potential from a map, or from any selection of it.

        Raises
        ------
        ParameterError
            If the map was made with another model, a parameter's coordinate is gone, or the
            attributes that hold the formula are damaged.
        """
        made: Self = parts.of_dataset(cls, ds)
        return made

    def __reduce__(self) -> Any:
        """Pickle what it was made from; the functions are made anew."""
        own = (str(self.formula.text), self.coordinate, self._values, self.period, self.interval)
        return _rebuild, own

    def __repr__(self) -> str:
        """Write the potential and its parameters, long arrays by their ends."""
        return parts.written(self)

    def _key(self) -> tuple[Any, ...]:
        formula = self.formula
        return formula.text, formula.coordinate, formula.names, formula.period, formula.interval

    def __eq__(self, other: object) -> bool:
        """Whether it is the same formula with equal parameters; NaN equals NaN."""
        if not isinstance(other, Potential):
            return NotImplemented
        return self._key() == other._key() and all(
            same(value, other._values[name]) for name, value in self._values.items()
        )

    def __hash__(self) -> int:
        """Hash of formula and parameters; one that holds DataArrays has none."""
        values = self._values.values()
        return hash(
            (
                *self._key(),
                *((v + 0.0).tobytes() if isinstance(v, np.ndarray) else v for v in values),
            )
        )


Potential.__init__ = named_arguments("Potential", Potential.__init__)  # type: ignore[method-assign]
MODELS["Potential"] = Potential


def _rebuild(
    text: str, coordinate: str, values: dict[str, Value], period: Any, interval: Any
) -> Potential:
    return Potential(text, coordinate, values, period, interval=interval)
