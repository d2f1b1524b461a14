"""Periodic orbits by collocation: found, followed, their multipliers and bifurcations."""
