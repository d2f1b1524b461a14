"""Bifurcations, arrays only: of the trigonometric law exactly, of any equations by continuation."""
