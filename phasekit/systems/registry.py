"""Every model by its name, as files hold it, whether it was used in this process or not."""

from __future__ import annotations

from collections.abc import Mapping

from phasekit.systems import bases
from phasekit.systems.system import System

#: Where models are; each registers itself when it is imported.
HOMES = (*bases.HOMES, "phasekit.systems.perturbed")


def models() -> Mapping[str, type[System]]:
    """Return every model by its name.

    >>> "Pendulum" in models()
    True
    """
    return bases.models(HOMES)


def model_named(argument: str, name: object) -> type[System]:
    """Return the model of a name."""
    return bases.named_model(argument, name, HOMES)
