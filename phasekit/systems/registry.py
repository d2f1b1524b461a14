"""Every model by its name, as files hold it, whether it was used in this process or not."""

from __future__ import annotations

import importlib
from collections.abc import Mapping

from phasekit.errors import ParameterError
from phasekit.labels.arguments import describe
from phasekit.systems.system import MODELS, System

#: Where models are; each registers itself when it is imported.
HOMES = (
    "phasekit.systems.disk",
    "phasekit.systems.analogues",
    "phasekit.systems.field_analogues",
    "phasekit.systems.potential",
    "phasekit.systems.free_rotor",
    "phasekit.systems.perturbed",
)


def models() -> Mapping[str, type[System]]:
    """Return every model by its name.

    Examples
    --------
    >>> "Pendulum" in models()
    True
    """
    for module in HOMES:
        importlib.import_module(module)
    return MODELS


def model_named(argument: str, name: object) -> type[System]:
    """Return the model of a name."""
    known = MODELS if name in MODELS else models()
    if not isinstance(name, str) or name not in known:
        raise ParameterError(
            f"{argument}: got a map of the model {describe(name)}, wants one of "
            f"{', '.join(known)}; one of your own is known once its module is imported"
        )
    return known[name]
