"""Compiled array kernels: floats and arrays in, arrays out, one quantity a module.

The arithmetic of one system is written once, as branch-free functions that LLVM inlines into
loops over blocks and vectorises there; orbits, which differ more, come one after the other. No
relaxed floating-point mode is used, so a point's result does not depend on the array, block or
thread that it is computed in.
"""
