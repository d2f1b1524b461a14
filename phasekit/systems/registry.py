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
    "phasekit.systems.potential",
    "phasekit.systems.free_rotor",
)


def every_model() -> dict[str, type[Model]]:
    """Return all models by their names.

    Examples
    --------
    >>> "Pendulum" in every_model()
    True
    """
    for module in HOMES:
        importlib.import_module(module)
    return MODELS


def model_named(argument: str, name: object) -> type[Model]:
    """Return the model of a name.

    Raises
    ------
    ParameterError
        If there is none.
    """
    models = MODELS if name in MODELS else every_model()
    if not isinstance(name, str) or name not in models:
        raise ParameterError(
            f"{argument}: got a map of the model {describe(name)}, wants one of {', '.join(models)}"
        )
    return models[name]
