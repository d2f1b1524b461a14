"""Compiled and exact tools that know no physics: arithmetic, launching, calls of native code."""
