"""Interval arithmetic: what is proved of formulas over whole boxes."""
