"""What every system shares: declared parameters, its law, validation, copies, rebuilding.

A class declares each parameter once, as a field, and states its law once; the constructor,
validation, sweeps, coordinates of maps and rebuilding from a map all follow from that.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar, NamedTuple, dataclass_transform

import numpy as np

from phasekit.errors import ParameterError
from phasekit.labels.arguments import (
    FloatArray,
    NumberLike,
    bad,
    brief,
    describe,
    named_arguments,
    same,
)
from phasekit.labels.grid import combine
from phasekit.laws.ladder import ANY, PERTURBED, Conservative, Law, Lawful, Standing, Trait
from phasekit.laws.terms import Rate
from phasekit.laws.trigonometric import Trigonometric, Values, checked_products
from phasekit.laws.trigonometric import law as make_law
from phasekit.systems.parameter import Parameter, attrs_of, parameter
from phasekit.systems.statement import LAWS, Stated, stated
from phasekit.systems.value import ModelValue

#: What terms of one's own bring in.
OWN_TRAITS = ANY & ~PERTURBED
#: Every model by its name, as maps store it.
MODELS: dict[str, type[System]] = {}


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(parameter,))
class System(ModelValue):
    """Base of all systems, and of your own: parameters are fields, and the law is stated once.

    A class declares each parameter by `parameter` and states one law:

    ``products``
        A function of the parameters with A N, B N, C N and N > 0, polynomials, for the
        trigonometric law ``phi'' = -B sin phi + A sin phi cos phi + C cos phi``. Everything is
        answered in closed form.
    ``potential``
        A formula V of the ``coordinate`` (`angle` or `coordinate`), per unit of inertia, for
        ``x'' = -V'(x)``. It is answered like a `Potential`.
    ``inertia``
        A formula M > 0 of the coordinate, an angle, beside a potential: the energy is
        ``M x'^2/2 + V``, and the motion ``M x'' + M' x'^2/2 + V' = 0``.
    ``rates``
        Formulas of ``x' = f(x)`` by state, or a function ``f(x, **parameters)``. It is answered
        like a `Problem`.
    ``step``
        The same of a map ``x -> f(x)``.

    Beside rates and steps stand ``states`` (their names, or a mapping from names to units and
    meaning), ``periods`` of states that are angles, and ``window``, ranges of the states, in which
    `equilibria` looks where no box is given.

    Systems are frozen, compared by value, and rebuilt from any map that they made. Files and worker
    processes find a class by its name once its module is imported.

    Parameters
    ----------
    *args, **parameters : float, 1-D array_like or xarray.DataArray
        The declared parameters by name; in their order as well, if the class is made with
        ``class Name(pk.System, kw_only=False)``.

    Raises
    ------
    ParameterError
        If a value is unusable. A class that states two laws, or one that cannot be read, or takes a
        reserved name, is refused where it is made.

    Examples
    --------
    >>> import phasekit as pk
    >>> class SpringHoop(pk.System):
    ...     spin = pk.parameter("s-1", "angular velocity of the hoop")
    ...     k = pk.parameter("s-2", "stiffness over mass", positive=True)
    ...     coordinate = pk.angle("theta")
    ...     potential = "k*(sqrt(5/4-cos(theta)) - 1/2)^2 - (spin*sin(theta))^2/2 - 9.8*cos(theta)"
    >>> pk.equilibria(SpringHoop(spin=6.0, k=10.0)).n_equilibria.item()
    4
    >>> import xarray as xr
    >>> magnet = pk.StonerWohlfarth(K=-2.0, h_x=1.0, h_y=0.5)
    >>> magnet.coefficients(), magnet.reduced()
    (Coefficients(A=4.0, B=1.0, C=0.5), Reduced(lam=0.25, psi=0.125, Omega_sq=4.0))
    >>> made_by = {"phasekit_model": "StonerWohlfarth", "phasekit_schema": "1"}
    >>> ds = xr.Dataset(coords=magnet.replace(h_x=3.0).parameters, attrs=made_by)
    >>> magnet.from_dataset(ds)
    StonerWohlfarth(K=-2.0, h_x=3.0, h_y=0.5)
    >>> magnet.formula_inputs(), magnet.unit_of("K"), magnet.products(magnet.parameters)
    (('K', 'h_x', 'h_y'), 's-2', (4.0, 1.0, 0.5, 1))
    >>> law, K = magnet.trigonometric(), magnet.in_domain("K", 1.0)
    >>> A, B, C = magnet.valid_coefficients({"K": K, "h_x": 1.0, "h_y": 2.0})
    >>> magnet.check()  # raises if the parameters make no system
    >>> class VanDerPol(pk.System):
    ...     mu = pk.parameter("1", "strength of the damping", default=1.0)
    ...     rates = {"x": "y", "y": "mu*(1 - x^2)*y - x"}
    >>> branch = pk.continuation(VanDerPol(), "mu", x0=[0.0, 0.0], span=(-1.0, 2.0))
    >>> [point.kind for point in branch.special("hopf")]
    ['hopf']
    """

    __slots__ = ()

    #: Parameters whose folds are known in closed form, with the function that solves for each.
    critical_values: ClassVar[Mapping[str, Callable[..., Any]]] = {}
    #: The rung of its law, which says what can be computed of it.
    rung: ClassVar[type[Law]] = Trigonometric
    #: The angular velocity of its frame: a change of it is felt as a torque.
    frame_rate: ClassVar[Rate | None] = None
    #: The law that the class states beside products.
    stated: ClassVar[Stated | None] = None
    kind_of_value: ClassVar[str] = "system"
    _guides: ClassVar[tuple[str, ...]] = ("system",)

    @classmethod
    def _states_itself(cls) -> bool:
        """Whether the body of the class declares parameters or states a law."""
        return super()._states_itself() or not vars(cls).keys().isdisjoint(LAWS)

    def __init_subclass__(cls, **keywords: Any) -> None:
        """Read the fields and the law, refuse what is none, and register the class."""
        super().__init_subclass__(**keywords)
        own = [name for name, one in vars(cls).items() if isinstance(one, Parameter)]
        law = vars(cls).get("products")
        if law is not None:
            units = {parameter.name: parameter.units for parameter in cls.declared}
            law = checked_products(cls.__name__, law.__func__, units)
            # By these names it travels to worker processes, whatever it was called before.
            law.__module__, law.__qualname__ = cls.__module__, f"{cls.__qualname__}.products"
            cls.products = staticmethod(law)  # type: ignore[assignment, method-assign]
        if (statement := stated(cls, cls.declared)) is not None:
            cls.stated, cls.rung = statement, statement.rung
            for name, one in statement.kept.items():
                setattr(cls, name, one)
        if own and cls.stated is None and cls.products is System.products:
            raise bad(cls.__name__, own, "a law: products, potential, rates or step")
        if own or law is not None or statement is not None:
            MODELS[cls.__name__] = cls

    def __init__(self, *args: Any, **parameters: Any) -> None:
        if not self.declared and type(self) is System:
            raise ParameterError("System: wants a class of your own that states a law")
        super().__init__(*args, **parameters)

    def check(self) -> None:
        """Refuse parameters that go together badly; each alone has been checked."""
        if self.stated is not None:
            self.stated.check(self)

    @staticmethod
    def products(v: Values) -> tuple[Any, Any, Any, Any]:
        """A N, B N, C N and N > 0 of the parameters: the model's law, stated by each.

        Parameters
        ----------
        v : mapping of str to value
            Parameters by name, angles as (sine, cosine, radius).

        Returns
        -------
        tuple of four values
            A N, B N and C N in N s^-2, and N.

        Raises
        ------
        ParameterError
            If a parameter is missing, or the law is not one of (A, B, C).
        """
        raise ParameterError(
            f"v: got {describe(v)}, wants the parameters of a system with coefficients "
            "(A, B, C), which this one has not"
        )

    @property
    def law(self) -> Law:
        """The law, and what follows from it."""
        return self.trigonometric() if self.stated is None else self.stated.law()

    @property
    def law_of_parameters(self) -> Law:
        """The law as a function of the parameters, where `law` is that of one system."""
        return self.law

    @classmethod
    @functools.cache
    def trigonometric(cls) -> Trigonometric:
        """The law of all systems of this kind, for those whose law is that of (A, B, C)."""
        declared = ((p.name, p.units, p.least, p.high) for p in cls.declared)
        return make_law(cls.products, tuple(declared))

    @property
    def answered_by(self) -> str:
        """What messages say of a system that a function cannot take."""
        return "" if self.stated is None else self.stated.answered_by

    @classmethod
    def formula_inputs(cls) -> tuple[str, ...]:
        """Names of the parameters on which the law depends.

        Returns
        -------
        tuple of str
        """
        return cls.trigonometric().parameters if cls.stated is None else cls.stated.inputs

    @classmethod
    def valid_coefficients(
        cls, parameters: Mapping[str, FloatArray]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coefficients in s^-2 from arrays that broadcast, NaN where a parameter leaves its domain.

        Parameters
        ----------
        parameters : mapping of str to array_like
            Those of `formula_inputs`, in SI units and radians.

        Returns
        -------
        A, B, C : ndarray
        """
        law = cls.trigonometric()
        used = {name: parameters[name] for name in law.parameters}
        with np.errstate(all="ignore"):
            valid = functools.reduce(
                np.logical_and, [p.valid(used[p.name]) for p in cls.declared if p.name in used]
            )
            A, B, C = law.coefficients(used)
            if not valid.all():
                A, B, C = (np.where(valid, x, np.nan) for x in (A, B, C))
        return A, B, C

    def _elsewhere(self, name: str) -> str:
        """Where parameters are that are no attributes, and states."""
        if name in self.parameters:
            return f'system.parameters["{name}"]'
        if name in getattr(self, "state", ()):
            return f"what pk.equilibria and pk.flow return: {name} is a state, with no value here"
        if name in ("A", "B", "C") and issubclass(self.rung, Trigonometric):
            return f"system.coefficients().{name}"
        return ""

    def _listed(self) -> str:
        """The names of its parameters."""
        return f"its parameters are {', '.join(self.parameters)}" if self.parameters else ""

    def coefficients(self) -> Coefficients:
        """Coefficients (A, B, C) of the equation of motion, all in s^-2.

        Returns
        -------
        Coefficients
            Floats, or DataArrays on the parameters' dims where a parameter is an array.
        """
        if not issubclass(self.rung, Trigonometric):
            raise bad(
                "system",
                self,
                f"{Trigonometric.called}; this needs the closed form",
                self.answered_by,
            )
        names = self.formula_inputs()
        used = {name: self.parameters[name] for name in names}

        def abc(*arrays: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            return self.valid_coefficients(dict(zip(names, arrays, strict=True)))

        attrs = attrs_of(*self.declared, *Coefficients.declared)
        results = combine(abc, used, Coefficients._fields, attrs)
        if not all(np.isfinite(x) for x in results if isinstance(x, float)):
            got = ", ".join(f"{name}={brief(value)}" for name, value in used.items())
            raise ParameterError(
                f"{type(self).__name__}: got {got}, whose coefficients are {results}; wants "
                "parameters of a size for which A, B and C are finite"
            )
        return Coefficients(*results)

    def reduced(self) -> Reduced:
        """Return the papers' form (lambda, psi, Omega^2); cells with ``A = 0`` become NaN.

        Returns
        -------
        Reduced
            Floats, or DataArrays as of `coefficients`; as [Veljovic2015] (12).

        Raises
        ------
        ParameterError
            If ``A = 0`` for a system of scalars, where lambda and psi are infinite.
        """
        attrs = attrs_of(*self.declared, *Reduced.declared)
        return Reduced(*reduced_form(*self.coefficients(), attrs))


class _ABC(NamedTuple):
    A: Any
    B: Any
    C: Any


class Coefficients(System, _ABC):
    """Coefficients of ``phi'' + B sin phi - A sin phi cos phi - C cos phi = 0``, in s^-2.

    A system by themselves; every other system reduces to them. Of any sign, zero included.

    Parameters
    ----------
    A, B, C : float, 1-D array_like or xarray.DataArray
        Coefficients of the potential ``V = -B cos phi + (A/2) cos^2 phi - C sin phi``.

    Raises
    ------
    ParameterError
        If a value is not a real, finite number or an array of numbers.

    Notes
    -----
    In the papers' notation ``A = Omega^2``, ``B = lambda Omega^2``, ``C = psi Omega^2``
    ([Veljovic2015] (12)).

    Examples
    --------
    >>> import phasekit as pk
    >>> c = pk.Coefficients(4.0, 1.0, 0.5)
    >>> c
    Coefficients(A=4.0, B=1.0, C=0.5)
    >>> A, B, C = c
    >>> c.replace(B=[1.0, 2.0])
    Coefficients(A=4.0, B=[1.0, 2.0], C=0.5)
    """

    __slots__ = ()

    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(name="A", units="s-2", long_name="coefficient of -sin(phi) cos(phi), Omega^2"),
        Parameter(name="B", units="s-2", long_name="coefficient of sin(phi), lambda Omega^2"),
        Parameter(name="C", units="s-2", long_name="coefficient of -cos(phi), psi Omega^2"),
    )

    def __new__(cls, A: NumberLike, B: NumberLike, C: NumberLike) -> Coefficients:
        """Check the values and keep them."""
        kept = [p.check(x) for p, x in zip(cls.declared, (A, B, C), strict=True)]
        return super().__new__(cls, *kept)

    def __init__(self, A: NumberLike, B: NumberLike, C: NumberLike) -> None:
        """Nothing is left to do: a tuple is made at once."""

    @classmethod
    def _make(cls, iterable: Iterable[Any]) -> Coefficients:  # type: ignore[override]
        """Make coefficients from three values, checked; ``_replace`` comes here as well."""
        return cls(*iterable)

    __iter__ = tuple.__iter__

    def coefficients(self) -> Coefficients:
        """Return itself: coefficients are a system.

        Returns
        -------
        Coefficients
        """
        return self

    @staticmethod
    def products(v: Values) -> tuple[Any, Any, Any, Any]:
        """The coefficients themselves."""
        return v["A"], v["B"], v["C"], 1

    def __eq__(self, other: object) -> bool:
        """Compare as a model with models, arrays included, and as a tuple with plain tuples."""
        if isinstance(other, System):
            return System.__eq__(self, other)
        if not isinstance(other, tuple) or len(other) != 3:
            return NotImplemented
        return all(same(x, y) for x, y in zip(self, other, strict=True))

    def __ne__(self, other: object) -> bool:
        """Return the opposite of ``==``, in place of the tuple's."""
        return not self == other

    def __hash__(self) -> int:
        """Hash as the tuple that it equals, or by the arrays that it holds."""
        return (
            tuple.__hash__(self) if all(isinstance(x, float) for x in self) else super().__hash__()
        )


Coefficients.__new__ = named_arguments("Coefficients", Coefficients.__new__)  # type: ignore[method-assign]
MODELS["Coefficients"] = Coefficients


class Reduced(System, kw_only=False):
    """The papers' reduced form, in lambda and psi.

    ``phi'' + Omega^2 (lam - cos phi) sin phi - Omega^2 psi cos phi = 0``.

    Parameters
    ----------
    lam, psi : float, 1-D array_like or xarray.DataArray
        Gravity and eccentric centrifugal force against the coupling term, of any sign.
    Omega_sq : float or array_like, default 1.0
        Omega^2 in s^-2; negative for a disk that is nearly in line with its shaft.

    Raises
    ------
    ParameterError
        If a value is not a real, finite number or an array of numbers.

    Notes
    -----
    [Veljovic2015] (12): ``A = Omega^2``, ``B = lam Omega^2``, ``C = psi Omega^2``.

    Examples
    --------
    >>> import phasekit as pk
    >>> pk.Reduced(0.25, 0.125, 4.0).coefficients()
    Coefficients(A=4.0, B=1.0, C=0.5)
    """

    lam: NumberLike = parameter("1", "lambda = B/A")
    psi: NumberLike = parameter("1", "psi = C/A")
    Omega_sq: NumberLike = parameter("s-2", "Omega^2 = A", default=1.0)

    @staticmethod
    def products(v: Values) -> tuple[Any, Any, Any, Any]:
        """[Veljovic2015] (12)."""
        return v["Omega_sq"], v["lam"] * v["Omega_sq"], v["psi"] * v["Omega_sq"], 1


# ------------------------------------------------------------------------------ arguments


def as_system(system: Any, *, rung: type[Law] = Law, what: str = "") -> System:
    """Return the system that an argument is.

    ``rung`` is where its law has to stand, because of ``what``.
    """
    if isinstance(system, System):
        return stands_on(system, rung, what)
    if not isinstance(system, type) and callable(getattr(system, "coefficients", None)):
        coefficients = system.coefficients()
        if isinstance(coefficients, tuple) and len(coefficients) == 3:
            return Coefficients(*coefficients)
    hint, problem = "", MODELS.get("Problem")  # which may not be loaded yet
    if isinstance(system, (tuple, list)) and len(system) == 3:
        hint = "three coefficients make one: pk.Coefficients(A, B, C)"
    elif isinstance(system, type):
        hint = "it is a class: call it with its parameters"
    elif hasattr(system, "data_vars"):
        hint = "a map gives its system back by ds.phasekit.system()"
    elif hasattr(system, "answered_by"):
        hint = system.answered_by
    elif problem is not None and issubclass(problem.rung, rung):
        hint = way_to_problem(system)
    names = [name for name, kind in MODELS.items() if issubclass(kind.rung, rung)]
    raise bad("system", system, f"one of {', '.join(names)}", hint)


def way_to_problem(thing: Any) -> str:
    """How a function or formulas are made a system; empty for anything else."""
    if isinstance(thing, str):
        return f"formulas make one: pk.Problem({{'x': {thing[:40]!r}}}, parameters=...)"
    if isinstance(thing, dict):
        return "formulas make one: pk.Problem({'x': '...'}, parameters=...)"
    return "pk.Problem(f, state=..., parameters=...) makes one" if callable(thing) else ""


def stands_on(
    system: System, where: type[Law] | Standing, what: str, *, tilted: bool = False
) -> System:
    """Return a system whose law stands on a rung, or on a more special one."""
    if system.standing.is_within(where):
        return system
    wanted = Standing.from_rung(where)
    if system.standing.traits is not None:
        more = system.standing.traits & ~(wanted.traits or Trait(0)) & OWN_TRAITS
        if more and wanted.traits is not None:
            raise ParameterError(
                f"system: got {system!r}, wants one without terms of your own for {what}; flow, "
                "equilibria, continuation, poincare_section, stroboscopic and lyapunov take them"
            )
        # What is a function of the potential alone.
        if issubclass(system.standing.rung, wanted.rung):
            hint = ""
            pushed = system.standing.is_within(Standing(Conservative, Trait.TORQUED))
            if pushed and not system.standing.rung.labels_fixed:
                hint = "; on a line, the torque can be a part of its potential: V - torque*x"
            raise ParameterError(
                f"system: got {system!r}, wants a system without damping and drive"
                f"{' but a constant torque' * tilted} for {what}; perturbed.system has none{hint}"
            )
    because = f"because {what} is in closed form" if wanted.rung.labels_fixed else f"for {what}"
    hint = f"; {system.answered_by}" if system.answered_by else ""
    raise ParameterError(f"system: got {system!r}, wants {wanted.called}, {because}{hint}")


def single(system: Any) -> tuple[Law, dict[str, float]]:
    """Return the law of one system, on whatever rung, and its parameters."""
    found: Lawful = system if isinstance(system, Lawful) else as_system(system)
    arrays = [name for name, value in found.parameters.items() if not isinstance(value, float)]
    if arrays:
        raise ParameterError(
            f"system: got array parameters ({', '.join(arrays)}), wants a single system; select "
            "one cell first: ds.isel(...).phasekit.system()"
        )
    return found.law, found.parameters


def reduced_form(A: Any, B: Any, C: Any, attrs: Any) -> tuple[Any, ...]:
    """Return lambda, psi and Omega^2 ([Veljovic2015] (12)); `System.reduced` has the words."""
    if isinstance(A, float) and A == 0.0:
        raise ParameterError(
            "A: got 0.0, wants A != 0, because lambda = B/A and psi = C/A; "
            "use .coefficients(), which has no such limit"
        )

    def divide(A: FloatArray, B: FloatArray, C: FloatArray) -> tuple[FloatArray, ...]:
        with np.errstate(all="ignore"):
            lam, psi = (np.where(A == 0, np.nan, x / A) for x in (B, C))
            return lam, psi, A + 0 * (B + C)

    values = combine(divide, {"A": A, "B": B, "C": C}, ("lam", "psi", "Omega_sq"), attrs)
    if not all(np.isfinite(value) for value in values if isinstance(value, float)):
        raise ParameterError(
            f"A: got {A!r} with B = {B!r} and C = {C!r}, wants a size for which "
            "lambda = B/A and psi = C/A are finite; use .coefficients(), which has no such "
            "limit"
        )
    return tuple(values)
