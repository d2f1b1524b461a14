"""Compiled integration of many motions at once, eight in the lanes of the processor."""
