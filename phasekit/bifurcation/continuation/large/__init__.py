"""Equilibria of thousands of states: sparse derivatives, one factorisation a step."""
