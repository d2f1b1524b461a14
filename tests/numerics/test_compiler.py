"""Kernels give the same bits compiled as interpreted, construct by construct."""

import cmath
import math
import os
import subprocess
import sys
from typing import Any, NamedTuple

import numpy as np
import pytest

from phasekit.numerics import forms
from phasekit.numerics.compile import inline, kernel, lanes, routine, twin
from phasekit.numerics.compiler.kinds import CompileError
from phasekit.numerics.native import call
from phasekit.numerics.pointers import invoke
from phasekit.numerics.values import normal

SIZES = (3.0, 5.0, 7.0, 11.0, 13.0)
PAIRS = ((1.0, -1.0), (2.0, -2.0), (3.0, -3.0))
TABLE = np.arange(6.0).reshape(2, 3)
PLACES = np.array([2, 0, 1])


@routine
def halves(x, by=2.0):
    return x / by, x - x / by


@inline
def clipped(x, low, high):
    return min(max(x, low), high)


class Both(NamedTuple):
    inner: Any
    last: float


def _doubled(w):
    for i in range(w.size):
        w[i] *= 2.0


@twin(_doubled)
def doubled(w):
    w *= 2.0


def reals(x, y, n, m, flag, out):
    a, b = halves(x)
    c, d = halves(y, by=4.0)
    out[0], out[1] = a * c - b / d, -(a + b) * +(c - d)
    out[2] = x % y
    out[3] = n % m
    out[4] = n // m
    out[5] = (n << 2 | 5) ^ m & 3
    out[6] = n >> 1
    out[7] = 1.0 if x < y <= 2.0 * y else -1.0
    out[8] = x if flag and not n == m else y
    out[9] = abs(x) + abs(n)
    out[10] = clipped(x, -0.5, 0.5) + min(n, m, 2) + max(x, n)
    out[11] = int(x) + float(n) + int(flag) + bool(m)
    out[12] = x ** (1.0 / 3.0) if x > 0.0 else (-x) ** 0.3
    out[13] = 2.0**-3 * x + 1e-300 * y
    out[14] = x**n if n > 0 else 0.0
    out[15] = math.floor(x) + math.ceil(y) + np.rint(x) + np.floor(y) + np.ceil(x) + np.sign(-x)
    out[16] = math.copysign(y, -x)
    out[17] = n / m
    out[18] = (x > 0.0) + 2 * (y > 0.0)
    out[19] = np.int64(x * 1e6) & 0xFF
    out[20] = np.int64((np.float64(x).view(np.int64) >> 52 & 0x7FF) << 52).view(np.float64)
    out[21] = 0.0 if math.isfinite(x) and not np.isnan(y) else 1.0
    out[22] = 5.0 if x != x or y == math.inf else SIZES[n % 5] * PAIRS[m % 3][1]
    out[23] = TABLE[1, PLACES[n % 3]] + TABLE.shape[1] + TABLE.size


def functions(x, out):
    out[0], out[1], out[2] = math.sin(x), math.cos(x), math.tan(x)
    out[3], out[4] = math.exp(-x), math.log(2.0 + x * x)
    out[5], out[6] = math.atan2(x, 0.3), math.sqrt(x * x + 0.1)
    out[7], out[8], out[9] = math.sinh(x), math.cosh(x), math.tanh(x)
    out[10], out[11], out[12] = math.asinh(x), math.expm1(x), math.atan(x)
    out[13], out[14] = math.acos(0.1 * x), math.asin(0.1 * x)
    out[15] = math.log2(3.0 + x)


def loops(n, m, w, out):
    total, count = 0, 0  # which becomes a float
    for i in range(n):
        if i == 3:
            continue
        if i > 6:
            break
        total += 0.5 * i
    else:
        total -= 1.0
    out[0] = total
    for i in range(n, -n, -m):
        count += i
    for i in (1, 4, 2):
        for j in range(i):
            if j == 2:
                break
            count += 10 * j
    out[1] = count
    side = np.zeros((2, 4))
    for i in range(n):
        for j in lanes(4):
            side[0, j] = w[0] + i * j
        for j in lanes(4):
            side[1, j] = 0.5 * j - side[0, j] if side[0, j] > side[1, j] else side[1, j] / 3.0
    out[7] = side[1, 0] - side[1, 1] * side[1, 2] + 0.1 * side[1, 3]
    k = 1
    while k < 100 and (k != 27 or n < 5):
        k *= 3
    out[2] = k
    while True:
        k -= 7
        if k < 0:
            break
    out[3] = k + i
    first, second = 1.0, 2.0
    for _ in range(m):
        first, second = second, first + second
    out[4], out[5] = first, second
    doubled(w[1:4])
    out[6] = w[-1] + w[0] + w[2]
    return total > 2.0, count, w[1]


def arrays(a, b, codes, flags, points, strided):
    n, m = a.shape
    row = a[1]
    spare, whole = np.zeros((n, m)), np.full(m, 0.5)
    numbers = np.empty(n, np.int64)
    marks = np.zeros(m, np.bool_)
    for i in range(n):
        numbers[i] = codes[i] * 2 - i
        for j in range(m):
            spare[i, j] = a[i, j] + row[j] * strided[j] + whole[j]
            marks[j] = marks[j] or spare[i, j] > 3.0
    part = spare[:, 1]
    copy = part.copy()
    part[:] = -1.0
    spare[0] = 7.0
    b[:n] = copy
    three = np.array([a[0, 0], 2.0, b[0]])
    for j in range(3):
        b[j] += three[j]
    values, kinds = points
    for j in range(m):
        values[j] = spare[n - 1, j]
        kinds[j] = numbers[j % n]
        flags[j] = marks[j]
    strided[0] = b[2]
    both = Both(three, b[1])
    return b.size + len(points) + both.inner[1] * Both(inner=three, last=2.0).last + both.last


def planes(z, w, out):
    u = z * w + 2j * z - 1.0 / w
    out[0] = u
    out[1] = cmath.exp(u) + cmath.sinh(w) * cmath.cosh(w)
    out[2] = cmath.sin(w) / cmath.cos(z)
    out[3] = complex(abs(u), u.real) + u.conjugate() * complex(0.5)
    out[4] = -u if u.imag > 0.0 else complex(0.0, 1.0)


def nothing(address, x, out):
    if address is not None:
        invoke(address, x, x, x, out)
    return None


FUNCTIONS = [reals, functions, loops, arrays, planes]
KERNELS = {function.__name__: kernel(function) for function in FUNCTIONS}


def arguments():
    rng = np.random.default_rng(8)
    for x, y, n, m in (
        (1.7, 0.3, 7, 3),
        (-2.3, 5.5, -7, 3),
        (0.4, -0.7, 9, -4),
        (-3.1, -1.2, -9, -2),
    ):
        for flag in (True, False):
            yield "reals", (x, y, n, m, flag, np.zeros(24))
    for x in rng.normal(size=20):
        yield "functions", (float(x), np.zeros(16))
    for n, m in ((3, 1), (5, 2), (12, 4), (0, 3)):
        yield "loops", (n, m, rng.normal(size=6), np.zeros(8))
    points = np.zeros(4), np.zeros(4, np.int8)
    rest = rng.normal(size=5), np.arange(3, dtype=np.int16), np.zeros(4, bool), points
    yield "arrays", (rng.normal(size=(3, 4)), *rest, rng.normal(size=8)[::2])
    yield (
        "planes",
        (complex(*rng.normal(size=2)), complex(*rng.normal(size=2)), np.zeros(5, complex)),
    )


def bits(x):
    """Every bit of arguments, or of a result, but the sign of NaN."""
    if isinstance(x, tuple):
        return tuple(map(bits, x))
    array = np.array(x)
    if array.dtype.kind in "fc":
        array = array + 0.0 if np.isfinite(array).all() else np.nan_to_num(array, nan=9e99)
    return array.dtype.kind, array.tobytes()


def copied(x):
    return tuple(map(copied, x)) if isinstance(x, tuple) else x.copy() if hasattr(x, "copy") else x


@pytest.mark.slow
@pytest.mark.parametrize("effort", [0, 1, 2])
def test_every_construct_gives_the_bits_of_the_interpreter(effort):
    compiled = {}
    for name, args in arguments():
        function = KERNELS[name].py_func
        kinds = tuple(normal(x)[1] for x in args)
        if name not in compiled:
            compiled[name] = forms.python_function(function, kinds, effort, make=True)
        own, other = copied(args), args
        assert bits(function(*own)) == bits(compiled[name](*other)), name
        assert bits(own) == bits(other), name


def test_a_kernel_takes_other_kinds_by_other_forms():
    loop = kernel(loops)
    for w in (np.arange(6.0), np.arange(12.0)[::2], np.arange(6.0).astype("f4")):
        found, out = np.zeros(8), np.zeros(8)
        assert loop(np.int32(5), 2, w, found)[:2] == loops(5, 2, np.ones(6), out)[:2]
    assert len(loop.forms) == 3
    wrong = (
        (1.5, 2, np.zeros(6), np.zeros(8)),  # range wants whole numbers
        (5, 2, np.zeros((6, 1)), np.zeros(8)),
    )
    for args in wrong:
        with pytest.raises(CompileError, match=r"test_compiler.py:\d+: "):
            loop(*args)
    for args in (
        (5, 2, np.zeros(6)),
        (5, 2, "six", np.zeros(8)),
        (5, 2, np.zeros(6, "M8[s]"), None),
    ):
        with pytest.raises(TypeError, match="loops|kernel"):
            loop(*args)


def test_results_do_not_depend_on_the_layout_of_python_objects(monkeypatch):
    """Where the entries cannot read them, numbers and addresses go through an array."""
    monkeypatch.setattr(forms.entry, "ITEMS", forms.entry.ITEMS - 8)
    monkeypatch.setattr(forms.entry, "readable", forms.entry.readable.__wrapped__)
    assert not forms.entry.readable()
    for name, args in [*arguments()][-6:]:
        function = KERNELS[name].py_func
        kinds = tuple(normal(x)[1] for x in args)
        framed = forms.python_function(function, kinds, 0, make=True)
        own = copied(args)
        assert bits(function(*own)) == bits(framed(*args)), name
        assert bits(own) == bits(args), name
        assert framed(None) is NotImplemented


@inline
def uses(x):
    return unknown_name + x  # noqa: F821


def recursive(x):
    return recursive_(x)


recursive_ = routine(recursive)


def both(x):
    if x > 0.0:
        y = 1.0
    else:
        y = np.zeros(2)
    return y


def early(x):
    if x > 0.0:
        return x


def generator(x):
    return sum(i for i in range(x))


def unmarked(x):
    return bits(x)


def cubed(x):
    return x[0] ** 2 + [1, 2][0] * x["a"]


@pytest.mark.parametrize(
    ("function", "argument", "says"),
    [
        (uses, 1.0, "unknown_name"),
        (recursive, 1.0, "calls itself"),
        (both, 1.0, "y: a variable is"),
        (early, 1.0, "return: a variable is"),
        (generator, 3, "GeneratorExp|sum"),
        (unmarked, 1.0, "bits"),
        (cubed, np.zeros(2), "an index is"),
        (lambda x: x, 1.0, "source"),
    ],
)
def test_what_is_not_translated_is_named_with_its_place(function, argument, says):
    with pytest.raises(CompileError, match=says) as caught:
        kernel(function)(argument)
    assert "lambda" in function.__name__ or "test_compiler.py:" in str(caught.value)


def test_a_function_by_its_address_or_none():
    from phasekit.numerics.machine_code import machine_code

    address = machine_code(
        "define void @fill(ptr %x, ptr %p, ptr %z, ptr %out) {\n"
        "  %v = load double, ptr %x\n  %w = fadd double %v, %v\n  store double %w, ptr %out\n"
        "  ret void\n}",
        host=False,
    )
    run, out = kernel(nothing), np.zeros(1)
    assert run(None, np.ones(1), out) is None
    assert out[0] == 0.0
    run(address, np.ones(1), out)
    assert out[0] == 2.0
    w = np.array([1.0, 0.0])
    call(lambda x, p, z, out: out.fill(x[0] + 4.0), w, 0, w, 0, 1)
    assert w[1] == 5.0


@pytest.mark.slow  # a process that ends by a signal
def test_indices_are_checked_where_that_is_asked_for(tmp_path):
    (tmp_path / "outside.py").write_text(
        "from phasekit.numerics.compile import kernel\n@kernel\ndef read(x, i):\n    return x[i]\n"
    )
    code = "import numpy as np, outside; print(outside.read(np.ones(3), {}))"
    for index, fine in ((2, True), (3, False)):
        done = subprocess.run(
            [sys.executable, "-c", code.format(index)], capture_output=True, text=True,
            cwd=tmp_path, env={**os.environ, "PHASEKIT_CHECK_INDICES": "1"},
        )  # fmt: skip
        assert (done.stdout == "1.0\n") == fine
        assert (done.returncode == 0) == fine
