"""Continuation with labels: branches, special points, diagrams, and the files they are kept in."""
