"""What a `Problem` can be made of: a potential, a system, and what was saved of a problem."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Self

from phasekit.labels.arguments import bad, flag
from phasekit.laws.formulas import symbols_of, take_formula
from phasekit.laws.ladder import Conservative
from phasekit.systems.as_equations import numbers
from phasekit.systems.grid import Axis
from phasekit.systems.problem_parts import names_of, specified, values_of
from phasekit.systems.statement import StatedRates
from phasekit.systems.system import System, as_system, stands_on


class ProblemSources:
    """Ways to a `Problem` beside its equations."""

    __slots__ = ()

    @classmethod
    def from_potential(
        cls,
        potential: Any,
        coordinate: str = "x",
        parameters: Mapping[str, float] | None = None,
        *,
        period: float | None = None,
    ) -> Self:
        """The planar conservative system ``x'' = -V'(x)`` with the states (x, dx).

        Parameters
        ----------
        potential : str or sympy.Expr
            V, a formula of the coordinate and the parameters.
        coordinate : str
            Its name; the velocity's is the same with a d before it.
        parameters : mapping of str to float, optional
            The parameters and their values.
        period : float, optional
            The period of the coordinate, where it is an angle.

        Returns
        -------
        Problem

        Raises
        ------
        ParameterError
            If V cannot be read, or a name has no value.

        Examples
        --------
        >>> import phasekit as pk
        >>> pk.Problem.from_potential("x**4/4 - x**2/2")
        Problem(x' = dx, dx' = -x**3 + x; conservative)
        """
        states = names_of("coordinate", (coordinate,))
        states += (f"d{coordinate}",)
        values = values_of("parameters", {} if parameters is None else parameters)
        symbols = symbols_of([*states, *values])
        V = take_formula(potential, symbols, "potential", "give parameters={'name': ...}")
        force = -V.diff(symbols[coordinate])
        periods = {} if period is None else {coordinate: period}
        make: Any = cls
        made: Self = make(
            [symbols[states[1]], force], states, values, periods=periods, conservative=True
        )
        return made

    @classmethod
    def mechanical(
        cls, M: Any, C: Any, K: Any, force: Any = None, forcing: Any = None, *,
        parameters: Mapping[str, Any] | None = None, coordinates: Any = None, time: str = "t",
        period: Any = None, jac: Callable[..., Any] | None = None,
        conservative: bool | None = None,
    ) -> Self:  # fmt: skip
        """The problem of masses or finite elements, ``M x'' + C x' + K x + f(x) = F(t)``.

        Its states are the coordinates and their rates. M is solved with, and not inverted.

        Parameters
        ----------
        M, C, K : array_like or sparse array, shape (n, n)
            Masses, damping and stiffness. M may couple accelerations, and is not singular.
        force : mapping or sequence of formulas, or callable, optional
            f: formulas by coordinate, or one for each, of the coordinates, their rates and the
            parameters; or a function ``force(x, **parameters)`` that returns n numbers.
        forcing : mapping or sequence of formulas, or callable, optional
            F: formulas of the time and the parameters; or a function ``forcing(t, **parameters)``.
        parameters : mapping of str to float, optional
            The parameters and their values.
        coordinates : str or sequence of str, optional
            Their names, by default ``x1, x2, ...`` and of one ``x``. Rates have a d before it.
        time : str, default "t"
            What the forcing calls the time.
        period : str, sympy.Expr or float, optional
            The period of the forcing. That of sines and cosines is found.
        jac : callable, optional
            ``jac(x, **parameters)``: of a function the derivatives of f by x, dense or sparse.
        conservative : bool, optional
            Whether energy is conserved. By default it is where there is neither damping nor forcing
            and the forces, as formulas, are those of a potential.

        Returns
        -------
        Problem

        Raises
        ------
        ParameterError
            If an argument is unusable.

        Notes
        -----
        ``x' = v, M v' = F - C v - K x - f(x)`` ([Kerschen2009]). Where forces are functions, or
        terms are more than 4,000, the rates are a function as well; otherwise they are formulas.
        Motions along one normal mode start at an eigenvector of ``K a = w^2 M a``.

        Examples
        --------
        >>> import numpy as np
        >>> import phasekit as pk
        >>> K = np.array([[2.0, -1.0], [-1.0, 2.0]])
        >>> chain = pk.Problem.mechanical(
        ...     np.eye(2), 0.1 * np.eye(2), K, {"x1": "x1**3"}, {"x1": "F*cos(w*t)"},
        ...     parameters={"F": 0.1, "w": 1.0},
        ... )
        >>> chain.state, chain.period
        (('x1', 'x2', 'dx1', 'dx2'), 2*pi/w)
        >>> chain([1.0, 0.0, 0.0, 0.0], t=0.0).tolist()
        [0.0, 0.0, -2.9, 1.0]
        >>> pk.Problem.mechanical(1.0, 0.0, 1.0, "x**3", parameters={"m": 1.0})
        Problem(x' = dx, dx' = -x**3 - x; m=1.0, conservative)
        """
        from phasekit.systems.mechanical import equations_of_motion

        matrices = {"M": M, "C": C, "K": K}
        places, named = equations_of_motion(
            matrices,
            force,
            forcing,
            parameters,
            coordinates,
            time,
            period,
            jac,
            conservative,
        )
        make: Any = cls
        made: Self = make(*places, **named)
        return made

    @classmethod
    def from_system(cls, system: System, *, arrays: bool = False) -> Self:
        """The problem of a system: its rates, its step, or phi' = -V'(phi) with its equilibria.

        Parameters
        ----------
        system : system
            A system in a potential, or one that states its rates or step.
        arrays : bool, default False
            Whether parameters may be arrays, of a system that states its rates or step.

        Returns
        -------
        Problem

        Raises
        ------
        ParameterError
            If a parameter is an array, or the system is damped or driven.
        """
        system = as_system(system)
        make: Any = cls
        if isinstance(stated := system.stated, StatedRates):
            own: Self = stated_problem(make, system, stated, arrays)
            return own
        system = stands_on(system, Conservative, "continuation")
        law: Any = system.law
        names = system.formula_inputs()
        values = numbers(system, names)
        x = law.coordinate
        force = -law.gradient_formula(symbols_of([x, *names]))
        periods = {} if law.period is None else {x: law.period}
        problem: Any = make([force], x, values, periods=periods, conservative=True)
        problem._set("system", system)
        kept: Self = problem
        return kept

    @classmethod
    def from_ode(cls, path: Any) -> Self:
        """The problem of a file of XPPAUT (.ode).

        Parameters
        ----------
        path : str or path
            The file.

        Returns
        -------
        Problem
            Its states, parameters and equations, with initial data as ``start``, ``aux`` as
            ``observables``, the axes of its first picture as ``window`` and folded states as
            ``periods``.

        Raises
        ------
        ParameterError
            If it holds what is no flow and no map, such as delays, integrals over the past, Markov
            processes, jumps, algebraic equations, tables and random numbers; with the line.

        Notes
        -----
        Formulas have the meaning that XPPAUT gives them [Ermentrout2002]: ``2^3^2`` is 64,
        comparisons are 0 or 1, ``heav(0)`` is 1, and case does not matter. Time that enters through
        sines and cosines of a common period makes the system forced.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import phasekit as pk
        >>> file = pathlib.Path(tempfile.mkdtemp()) / "fhn.ode"
        >>> written = file.write_text('''
        ... dv/dt=f(v)-w+I
        ... w'=eps*(v-gamma*w)
        ... f(v)=v*(1-v)*(v-a)
        ... par I=0,a=.25,eps=.1,gamma=1
        ... init v=.3
        ... done
        ... ''')
        >>> neuron = pk.Problem.from_ode(file)
        >>> neuron.state, neuron.parameters["gamma"], dict(neuron.start)
        (('v', 'w'), 1.0, {'v': 0.3, 'w': 0.0})
        >>> neuron([0.5, 0.0]).tolist()
        [0.0625, 0.05]
        """
        from phasekit.systems.ode_problem import read_ode

        made: Self = read_ode(path, cls).problem
        return made

    @classmethod
    def from_sbml(cls, path: Any) -> Self:
        """The problem of a model of reactions in SBML; needs the extra ``phasekit[sbml]``.

        Parameters
        ----------
        path : str or path
            The file.

        Returns
        -------
        Problem
            Its states are the species that reactions or rules change, as concentrations, or as
            amounts where the model says so. Amounts that are conserved are parameters,
            ``total_A``, and as many species ``observables``. Initial values are its ``start``.

        Raises
        ------
        ParameterError
            If libsbml is not installed, the file is no valid SBML, or it holds what is no flow:
            events, delays, algebraic rules, functions with jumps, varying compartments.

        Notes
        -----
        Of the stoichiometry N the conserved sums are a basis of the g with g N = 0, exact, with
        coefficients >= 0 where these span it [SchusterHofer1991].

        Examples
        --------
        >>> import phasekit as pk
        >>> pk.Problem.from_sbml("none.xml")
        Traceback (most recent call last):
        ...
        phasekit.errors.ParameterError: path: got 'none.xml', wants the path of an SBML file; No...
        """
        from phasekit.systems.sbml_problem import read_sbml

        made: Self = read_sbml(path, cls)
        return made

    @classmethod
    def from_antimony(cls, text: Any) -> Self:
        """The problem of a model of reactions in Antimony; needs the extra ``phasekit[sbml]``.

        Parameters
        ----------
        text : str or path
            The model, or the path of its file.

        Returns
        -------
        Problem
            As of `from_sbml`.

        Raises
        ------
        ParameterError
            As of `from_sbml`.

        Notes
        -----
        Antimony's own library makes SBML of it.

        Examples
        --------
        >>> import phasekit as pk
        >>> binding = '''
        ... A + B -> AB; on*A*B
        ... AB -> A + B; off*AB
        ... A = 3; B = 2; on = 1; off = 0.5
        ... '''
        >>> model = pk.Problem.from_antimony(binding)  # doctest: +SKIP
        >>> model.state, model.parameters["total_A"]  # doctest: +SKIP
        (('A',), 3.0)
        """
        from phasekit.systems.sbml_problem import read_antimony

        made: Self = read_antimony(text, cls)
        return made

    def specification(self, *, values: bool = True) -> dict[str, Any]:
        """What is needed to make the problem again, as plain values; f is None if it is code.

        Parameters
        ----------
        values : bool, default True
            Whether the values of the parameters are a part of it, or their names alone.

        Returns
        -------
        dict
            Numbers, strings, lists and mappings, which JSON can hold.
        """
        flag("values", values)
        return specified(self, values)

    @classmethod
    def from_specification(cls, spec: Mapping[str, Any]) -> Self | None:
        """Make a problem of what `specification` gave of no system; None where f was code.

        Parameters
        ----------
        spec : mapping
            What `specification` returned.

        Returns
        -------
        Problem or None

        Raises
        ------
        ParameterError
            If it is something else.
        """
        keys = ("f", "state", "parameters", "periods", "conservative")
        if not isinstance(spec, Mapping) or not spec.keys() >= set(keys):
            raise bad("spec", spec, "what Problem.specification returns")
        if spec["f"] is None:
            return None
        make: Any = cls
        grid = [Axis.from_stated(one) for one in spec.get("grid", ())] or None
        made: Any = make(
            spec["f"], None if grid else spec["state"], spec["parameters"], grid=grid,
            periods=spec["periods"], conservative=spec["conservative"],
            time=spec.get("time"), period=spec.get("period"),
            map=bool(spec.get("map", False)), window=spec.get("window"),
            start=spec.get("start"), observables=spec.get("observables"),
            noise=spec.get("noise"),
        )  # fmt: skip
        times = spec.get("times", 1)
        made = made.iterated(times) if times != 1 else made
        described: Self = made.described(spec.get("words", {}))
        return described


def stated_problem(make: Any, system: System, stated: StatedRates, arrays: bool) -> Any:
    """The problem of a system whose class states rates or a step."""
    values: dict[str, Any] = {name: system.parameters[name] for name in stated.inputs}
    if not arrays:
        values = numbers(system, stated.inputs)
    words = {p.name: {"units": p.units, "long_name": p.long_name} for p in system.declared}
    problem = make(
        stated.f, stated.states, values, periods=stated.periods, map=stated.map,
        window=stated.window,
    )  # fmt: skip
    return problem.described({**{name: words[name] for name in values}, **stated.words})
