"""Compiled continuation: defining systems, Newton's method and the walk along a curve."""
