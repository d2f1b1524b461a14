"""Continuation of equilibria of any smooth system, arrays only."""
