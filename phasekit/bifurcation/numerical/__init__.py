"""Bifurcations of equilibria in any potential: found in boxes, proved by interval arithmetic."""
