"""The rim of phasekit: systems, labelled functions, sweeps and stored maps, as xarray Datasets."""

from __future__ import annotations
