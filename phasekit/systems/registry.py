"""Every model by its name, as files hold it, whether it was used in this process or not."""

from __future__ import annotations

import importlib

from phasekit.errors import ParameterError
from phasekit.labels.arguments import describe
from phasekit.systems.system import MODELS, Model

#: Where models are; each registers itself when it is imported.
HOMES = (
    "phasekit.systems.disk",
    "phasekit.systems.analogues",
    "phasekit.systems.field_analogues",
    "phasekit.systems.potential",
    "phasekit.systems.free_rotor",
    "phasekit.systems.perturbed",
)


def model_named(argument: str, name: object) -> type[Model]:
    """Return the model of a name.

    Raises
    ------
    ParameterError
        If there is none.
    """
    if name not in MODELS:
        for module in HOMES:
            importlib.import_module(module)
    if not isinstance(name, str) or name not in MODELS:
        raise ParameterError(
            f"{argument}: got a map of the model {describe(name)}, wants one of {', '.join(MODELS)}"
        )
    return MODELS[name]
