"""Sweeps over parameters, and the stores that keep their maps."""
