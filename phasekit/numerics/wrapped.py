"""Functions that numba compiled, as native functions of pointers."""

from __future__ import annotations

from typing import Any

from phasekit.errors import ParameterError


def wrap(
    function: Any, n: int, order: tuple[int | None, ...], *, less: bool = False, lanes: int = 1,
    tangents: int = 0,
) -> Any:  # fmt: skip
    """Wrap f(x, ...) as ``void (double *x, double *p, double *z, double *out)``.

    f is compiled by ``numba.njit`` and returns n numbers, or for n = 1 one. The order says of each
    argument after x its place in p; None: the time, the first entry of z. With `less` x is taken
    away from the result. Of several lanes entry i of point l is in place lanes i + l; so many
    tangents behind x are multiplied by the derivatives of f, central differences along them. What
    is returned has to be kept as long as its ``address`` is called.
    """
    import numba
    from numba import types

    carray: Any = numba.carray  # type: ignore[attr-defined]
    cfunc: Any = numba.cfunc
    space: dict[str, Any] = {"f": function, "carray": carray}
    pointer: Any = types.CPointer(types.float64)  # type: ignore[no-untyped-call]
    signature = types.void(pointer, pointer, pointer, pointer)
    first = None
    for single in (False, True)[: 2 if n == 1 else 1]:
        source = _single(n, order, less, single)
        if lanes > 1:
            source = _lanes(n, order, single, tangents)
        try:
            exec(source.replace("LANES", str(lanes)), space)
            return cfunc(signature, error_model="numpy")(space["wrapped"])
        except Exception as error:
            first = first or error
            last = error
    result = function.py_func if hasattr(function, "py_func") else function
    name = getattr(result, "__name__", "f")
    raise ParameterError(
        f"f: got the compiled function {name}, which numba cannot call with a float64 array "
        f"and floats and index {n} numbers of what it returns: {last}"
    ) from last


def _arguments(order: tuple[int | None, ...], entry: str, time: str) -> str:
    return ", ".join(["x", *(time if i is None else entry.format(i) for i in order)])


def _single(n: int, order: tuple[int | None, ...], less: bool, single: bool) -> str:
    places = [i for i in order if i is not None]
    lines = [
        "def wrapped(x_, p_, z_, out):",
        f"    x = carray(x_, ({n},))",
        f"    p = carray(p_, ({max(places, default=0) + 1},))",
        f"    value = f({_arguments(order, 'p[{}]', 'z_[0]')})",
    ]
    value = "value" if single else "value[{}]"
    lines += [f"    out[{i}] = {value.format(i)}" + f" - x[{i}]" * less for i in range(n)]
    return "\n".join(lines)


def _lanes(n: int, order: tuple[int | None, ...], single: bool, tangents: int) -> str:
    value = "value" if single else "value[{}]"
    call = f"f({_arguments(order, 'p_[{} * LANES + lane]', 'z_[lane]')})"
    lines = [
        "import numpy as np",
        "def wrapped(x_, p_, z_, out):",
        f"    x, start, slope = np.empty({n}), np.empty({n}), np.empty({n})",
        "    for lane in range(LANES):",
        "        large = 1e-300",
        f"        for i in range({n}):",
        "            start[i] = x[i] = x_[i * LANES + lane]",
        "            large = max(large, abs(x[i]))",
        f"        for i in range({n * (1 + tangents)}):",
        "            out[i * LANES + lane] = np.nan",
        "        if not np.isfinite(x.sum()):",
        "            continue",
        f"        value = {call}",
        *(f"        out[{i} * LANES + lane] = {value.format(i)}" for i in range(n)),
        f"        for k in range({n}, {n * (1 + tangents)}, {n}):",
        "            length = 0.0",
        f"            for i in range({n}):",
        "                length += x_[(k + i) * LANES + lane] ** 2",
        "            h = 6e-6 * large / np.sqrt(length)",
        f"            for i in range({n}):",
        "                x[i] = start[i] + h * x_[(k + i) * LANES + lane]",
        f"            value = {call}",
        *(f"            slope[{i}] = {value.format(i)}" for i in range(n)),
        f"            for i in range({n}):",
        "                x[i] = start[i] - h * x_[(k + i) * LANES + lane]",
        f"            value = {call}",
        *(f"            slope[{i}] -= {value.format(i)}" for i in range(n)),
        f"            for i in range({n}):",
        "                out[(k + i) * LANES + lane] = slope[i] / (2.0 * h)",
    ]
    return "\n".join(lines)
