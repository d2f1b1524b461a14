"""Models in a potential by their names, as files hold them; what may be perturbed."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence

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
)


def models(homes: Sequence[str] = HOMES) -> Mapping[str, type[System]]:
    """Return the models of some modules, and all others that are known, by name."""
    for module in homes:
        importlib.import_module(module)
    return MODELS


def named_model(argument: str, name: object, homes: Sequence[str] = HOMES) -> type[System]:
    """Return the model of a name, whether it was used in this process or not."""
    known = MODELS if name in MODELS else models(homes)
    if not isinstance(name, str) or name not in known:
        raise ParameterError(
            f"{argument}: got a map of the model {describe(name)}, wants one of "
            f"{', '.join(known)}; one of your own is known once its module is imported"
        )
    return known[name]
