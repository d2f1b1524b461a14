"""The system that an argument is, on the rung of the ladder of laws that is needed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from phasekit.errors import ParameterError
from phasekit.labels.arguments import bad
from phasekit.laws.ladder import Law, Lawful
from phasekit.laws.perturbed import PerturbedConservative, TiltedConservative
from phasekit.systems.system import MODELS, Model


def as_system(system: Any, *, rung: type[Law] = Law, what: str = "") -> Model:
    """Return the system that an argument is.

    Parameters
    ----------
    system : Any
        What was given.
    rung : type, optional
        The rung of the ladder on which its law has to stand.
    what : str, optional
        What needs that.

    Raises
    ------
    ParameterError
        If it is not a system, with the way from what it is to one.
    """
    if isinstance(system, Model):
        return system if issubclass(system.rung, rung) else stands_on(system, rung, what)
    make: Callable[..., Model] = MODELS["Coefficients"]
    if not isinstance(system, type) and callable(getattr(system, "coefficients", None)):
        coefficients = system.coefficients()
        if isinstance(coefficients, tuple) and len(coefficients) == 3:
            return make(*coefficients)
    hint = ""
    if isinstance(system, (tuple, list)) and len(system) == 3:
        hint = "three coefficients make one: pk.Coefficients(A, B, C)"
    elif isinstance(system, type):
        hint = "it is a class: call it with its parameters"
    elif hasattr(system, "data_vars"):
        hint = "a map gives its system back by ds.phasekit.system()"
    raise bad("system", system, f"one of {', '.join(MODELS)}", hint)


def stands_on(system: Model, rung: type[Law], what: str, *, tilted: bool = False) -> Model:
    """Return a system whose law stands on a rung, or on a more special one.

    Raises
    ------
    ParameterError
        If it does not.
    """
    if issubclass(system.rung, rung):
        return system
    if issubclass(system.rung, PerturbedConservative):
        # What is a function of the potential alone.
        if issubclass(getattr(system, "system", system).rung, rung):
            hint = ""
            if issubclass(system.rung, TiltedConservative):
                hint = "; on a line, the torque can be a part of its potential: V - torque*x"
            raise ParameterError(
                f"system: got {system!r}, wants a system without damping and drive"
                f"{' but a constant torque' * tilted} for {what}; perturbed.system has none{hint}"
            )
    because = f"because {what} is in closed form" if rung.labels_fixed else f"for {what}"
    raise ParameterError(f"system: got {system!r}, wants {rung.called}, {because}")


def single(system: Any) -> tuple[Law, dict[str, float]]:
    """Return the law of one system, on whatever rung, and its parameters.

    Raises
    ------
    ParameterError
        If it is no system, or a parameter is an array.
    """
    found: Lawful = system if isinstance(system, Lawful) else as_system(system)
    arrays = [name for name, value in found.parameters.items() if not isinstance(value, float)]
    if arrays:
        raise ParameterError(
            f"system: got array parameters ({', '.join(arrays)}), wants a single system; select "
            "one cell first: ds.isel(...).phasekit.system()"
        )
    return found.law, found.parameters
