"""The rim of phasekit: systems, labelled functions, sweeps and stored maps, as xarray Datasets."""

from __future__ import annotations

from phasekit.labelled import accessor, guises, models, potential_system

__all__ = ["accessor", "guises", "models", "potential_system"]
