"""The version of phasekit."""

__version__ = "0.1.0"
