"""Stiff motions, eight at once: a Rosenbrock method of order 5 with exact derivatives.

Rodas5P [Steinebach2023]: eight stages, each of which solves a linear system of I/(g h) - J; no
iteration, so that the lanes go in step. It is stiffly accurate. Its interpolation has order 4, and
less where a motion is very stiff: there steps end at the times that are asked for.
"""

from __future__ import annotations

import math

import numpy as np

from phasekit.arrays import Array, Index
from phasekit.motion.kernels.dop853 import ATOL, LEAST, MOST, OWN, RTOL
from phasekit.motion.kernels.stepping import careful_step
from phasekit.motion.lost import ARRIVED, EXHAUSTED, FAILED, RUNNING
from phasekit.numerics.compile import inline, kernel, routine
from phasekit.numerics.lanes import LANES, invoke

#: Coefficients of Rodas5P [Steinebach2023].
GAMMA = 0.21193756319429014
STAGES = 8
A = np.zeros((STAGES, STAGES))
A[1, :1] = (3.0,)
A[2, :2] = 2.849394379747939, 0.45842242204463923
A[3, :3] = -6.954028509809101, 2.489845061869568, -10.358996098473584
A[4, :4] = 2.8029986275628964, 0.5072464736228206, -0.3988312541770524, -0.04721187230404641
A[5, :5] = (
    -7.502846399306121, 2.561846144803919, -11.627539656261098, -0.18268767659942256,
    0.030198172008377946,
)  # fmt: skip
A[6, :6] = *A[5, :5], 1.0
A[7, :7] = *A[5, :5], 1.0, 1.0
C = np.zeros((STAGES, STAGES))
C[1, :1] = (-14.155112264123755,)
C[2, :2] = -17.97296035885952, -2.859693295451294
C[3, :3] = 147.12150275711716, -1.41221402718213, 71.68940251302358
C[4, :4] = 165.43517024871676, -0.4592823456491126, 42.90938336958603, -5.961986721573306
C[5, :5] = (
    24.854864614690072, -3.0009227002832186, 47.4931110020768, 5.5814197821558125,
    -0.6610691825249471,
)  # fmt: skip
C[6, :6] = (
    30.91273214028599, -3.1208243349937974, 77.79954646070892, 34.28646028294783,
    -19.097331116725623, -28.087943162872662,
)  # fmt: skip
C[7, :7] = (
    37.80277123390563, -3.2571969029072276, 112.26918849496327, 66.9347231244047,
    -40.06618937091002, -54.66780262877968, -9.48861652309627,
)  # fmt: skip
TIMES = np.array(
    [0.0, 0.6358126895828704, 0.4095798393397535, 0.9769306725060716, 0.4288403609558664, 1, 1, 1]
)
RATES = np.array(
    [
        0.21193756319429014, -0.42387512638858027, -0.3384627126235924, 1.8046452872882734,
        2.325825639765069, 0.0, 0.0, 0.0,
    ]
)  # fmt: skip
DENSE = np.array(
    [
        [
            25.948786856663858, -2.5579724845846235, 10.433815404888879, -2.3679251022685204,
            0.524948541321073, 1.1241088310450404, 0.4272876194431874, -0.17202221070155493,
        ],
        [
            -9.91568850695171, -0.9689944594115154, 3.0438037242978453, -24.495224566215796,
            20.176138334709044, 15.98066361424651, -6.789040303419874, -6.710236069923372,
        ],
        [
            11.419903575922262, 2.8879645146136994, 72.92137995996029, 80.12511834622643,
            -52.072871366152654, -59.78993625266729, -0.15582684282751913, 4.883087185713722,
        ],
    ]
)  # fmt: skip

#: Bounds of the change of a step, and the part of what its error allows.
SHORTEST, LONGEST, SAFE = 0.2, 6.0, 0.9
#: Steps after which the pace of a motion tells, and how much slower it may be there than later.
TRIAL, SLOWER = 256, 16.0
_EPS = float(np.finfo(float).eps)


@inline
def evaluate(address: int, x: Array, p: Array, z: Array, y: Array) -> None:
    """Y = f(x) of all lanes at the times z."""
    invoke(address, x, p, z, y)


@routine
def decompose(n: int, lane: int, h: float, slopes: Array, w: Array, pivots: Index) -> bool:
    """The LU decomposition of I/(g h) - J of a lane; whether it has one."""
    for i in range(n):
        for j in range(n):
            w[lane, i, j] = -slopes[(i * n + j) * LANES + lane]
        w[lane, i, i] += 1.0 / (GAMMA * h)
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(w[lane, i, k]) > abs(w[lane, best, k]):
                best = i
        pivots[lane, k] = best
        if best != k:
            for j in range(n):
                w[lane, k, j], w[lane, best, j] = w[lane, best, j], w[lane, k, j]
        head = w[lane, k, k]
        if not abs(head) > 0.0 or not abs(head) < np.inf:
            return False
        for i in range(k + 1, n):
            factor = w[lane, i, k] / head
            w[lane, i, k] = factor
            if factor != 0.0:
                for j in range(k + 1, n):
                    w[lane, i, j] -= factor * w[lane, k, j]
    return True


@routine
def solve(n: int, lane: int, w: Array, pivots: Index, b: Array) -> None:
    """Solve in place for the entries of a lane."""
    for k in range(n):
        other = pivots[lane, k]
        if other != k:
            a = b[k * LANES + lane]
            b[k * LANES + lane] = b[other * LANES + lane]
            b[other * LANES + lane] = a
    # Rows were exchanged whole, so that all exchanges come first.
    for k in range(n):
        for i in range(k + 1, n):
            b[i * LANES + lane] -= w[lane, i, k] * b[k * LANES + lane]
    for k in range(n - 1, -1, -1):
        total = b[k * LANES + lane]
        for j in range(k + 1, n):
            total -= w[lane, k, j] * b[j * LANES + lane]
        b[k * LANES + lane] = total / w[lane, k, k]


@routine
def error_of(n: int, lane: int, limits: Array, size: Array, x: Array, y: Array, e: Array) -> float:
    """Error of a step over what is allowed, as errors of explicit steps are measured."""
    for c in range(n):
        m = c * LANES + lane
        size[lane] = max(size[lane], max(abs(x[m]), abs(y[m])))
    total = 0.0
    for c in range(n):
        m = c * LANES + lane
        scale = limits[OWN + 2 * c + 1, 0]
        least = scale if scale > 0.0 else min(size[lane], 1.0)
        reach = min(max(abs(x[m]), abs(y[m])), limits[OWN + 2 * c, 0])
        allowed = limits[RTOL, 0] * reach + max(limits[ATOL, 0] * least, LEAST)
        total += (e[m] / allowed) ** 2
    return math.sqrt(total / n)


@routine
def first_step(n: int, lane: int, limits: Array, x: Array, f: Array, span: float) -> float:
    """A first step, shorter than the time in which the state changes by itself."""
    size = speed = 0.0
    for c in range(n):
        m = c * LANES + lane
        scale = limits[ATOL, 0] + limits[RTOL, 0] * abs(x[m])
        size += (x[m] / scale) ** 2
        speed += (f[m] / scale) ** 2
    size, speed = math.sqrt(size), math.sqrt(speed)
    h = careful_step(lane, x, f, abs(span))
    if size > 1e-5 and speed > 1e-5:
        h = 0.001 * size / speed
    return math.copysign(min(h, abs(span)), span)


@routine
def write(
    lane: int, n: int, times: Array, done: int, start: float, h: float, last: bool, x: Array,
    y: Array, k: Array, out: Array,
) -> int:  # fmt: skip
    """Write the states of a lane at the times within its step; return how many are written."""
    sense = 1.0 if h > 0.0 else -1.0
    while done < times.size and (last or sense * (times[done] - start) <= sense * h):
        s = min((times[done] - start) / h, 1.0)
        r = 1.0 - s
        for c in range(n):
            m = c * LANES + lane
            if s == 1.0:
                out[done, c] = y[m]
                continue
            bend = 0.0
            for row in range(2, -1, -1):
                part = 0.0
                for j in range(STAGES):
                    part += DENSE[row, j] * k[j, m]
                bend = bend * s + part
            out[done, c] = r * x[m] + s * (y[m] + r * bend)
        done += 1
    return done


@routine
def bend(n: int, lane: int, k: Array, e: Array) -> None:
    """The last term of the interpolation in the middle of a step, as a bound of its error."""
    for c in range(n):
        m = c * LANES + lane
        part = 0.0
        for j in range(STAGES):
            part += DENSE[2, j] * k[j, m]
        e[m] = 0.0625 * part


@kernel
def rosenbrock(
    address: int,
    derivatives: int,
    limits: Array,
    start: float,
    times: Array,
    states: Array,
    parameters: Array,
    first: int,
    stop: int,
    out: Array,
    status: Index,
    steps: Index,
) -> None:
    """Integrate the motions of cells; times are all after the start or all before it, in order.

    The code at `derivatives` gives the matrix of slopes by rows, then the derivatives by time.
    Shapes are those of `motions`. Of a motion that failed the last state is where the last of them
    would be.
    """
    n = states.shape[1]
    size = n * LANES
    x, y, f, u = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    k, slopes = np.zeros((STAGES, size)), np.zeros((n + 1) * size)
    p, z = np.zeros(max(parameters.shape[0], 1) * LANES), np.zeros(3 * LANES)
    w, pivots = np.zeros((LANES, n, n)), np.zeros((LANES, n), np.int64)
    t, h, end, tried = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    aim = np.zeros(LANES)
    largest, state = np.zeros(LANES), np.zeros(LANES, np.int64)
    taken, written, fell = np.zeros(LANES, np.int64), np.zeros(LANES, np.int64), np.zeros(LANES)
    good = np.zeros(LANES, np.int64)
    most = int(limits[MOST, 0])
    for begun in range(first, stop, LANES):
        own = min(LANES, stop - begun)
        for lane in range(LANES):
            cell = begun + min(lane, own - 1)
            for c in range(n):
                x[c * LANES + lane] = states[cell, c]
            for c in range(parameters.shape[0]):
                p[c * LANES + lane] = parameters[c, cell]
            t[lane], h[lane], largest[lane], fell[lane] = start, 0.0, 0.0, 0.0
            aim[lane] = 0.0
            taken[lane] = written[lane] = 0
            state[lane] = RUNNING if lane < own else ARRIVED
            if lane < own:
                row = times[cell if times.shape[0] > 1 else 0]
                end[lane] = row[-1]
                done = 0
                while done < row.size and row[done] == start:
                    for c in range(n):
                        out[cell, done, c] = states[cell, c]
                    done += 1
                written[lane] = done
                if done == row.size:
                    state[lane] = ARRIVED
        while True:
            running = False
            for lane in range(LANES):
                running = running or state[lane] == RUNNING
                z[lane] = t[lane]
            if not running:
                break
            evaluate(address, x, p, z, f)
            evaluate(derivatives, x, p, z, slopes)
            for lane in range(LANES):
                tried[lane] = 1.0
                good[lane] = 0
                if state[lane] != RUNNING:
                    continue
                span = end[lane] - t[lane]
                if h[lane] == 0.0:
                    h[lane] = first_step(n, lane, limits, x, f, span)
                step = h[lane] if aim[lane] == 0.0 else aim[lane]
                if abs(step) >= abs(span):
                    step = span
                elif abs(step) > 0.5 * abs(span) and aim[lane] == 0.0:
                    step = 0.5 * span
                tried[lane] = step
                good[lane] = decompose(n, lane, step, slopes, w, pivots)
            for i in range(STAGES):
                for lane in range(LANES):
                    z[lane] = t[lane] + TIMES[i] * tried[lane]
                for m in range(size):
                    total = x[m]
                    for j in range(i):
                        total += A[i, j] * k[j, m]
                    u[m] = total
                if i > 0:
                    evaluate(address, u, p, z, f)
                for lane in range(LANES):
                    if good[lane] == 0:
                        continue
                    step = tried[lane]
                    for c in range(n):
                        m = c * LANES + lane
                        total = f[m] + step * RATES[i] * slopes[n * size + m]
                        for j in range(i):
                            total += C[i, j] / step * k[j, m]
                        k[i, m] = total
                    solve(n, lane, w, pivots, k[i])
            for m in range(size):
                y[m] = u[m] + k[STAGES - 1, m]
            for lane in range(own):
                if state[lane] != RUNNING:
                    continue
                taken[lane] += 1
                step, error = tried[lane], np.inf
                if good[lane] != 0:
                    error = error_of(n, lane, limits, largest, x, y, k[STAGES - 1])
                change = SHORTEST
                if error < np.inf:
                    change = SAFE * max(error, 1e-10) ** -0.2
                    change = min(max(change, SHORTEST), LONGEST)
                row = times[begun + lane if times.shape[0] > 1 else 0]
                wanted = row[written[lane]] - t[lane]
                if error <= 1.0 and abs(wanted) < abs(step):
                    # Where it would not do to interpolate, steps end at the times asked for.
                    bend(n, lane, k, u)
                    if not error_of(n, lane, limits, largest, x, y, u) <= 1.0:
                        aim[lane] = wanted
                        continue
                aimed = aim[lane] != 0.0
                aim[lane] = 0.0
                if not error <= 1.0:
                    h[lane] = step * min(change, 0.9)
                    fell[lane] = 1.0
                    if not abs(h[lane]) > 4.0 * _EPS * abs(t[lane]) or h[lane] == 0.0:
                        state[lane] = FAILED
                else:
                    last = step == end[lane] - t[lane]
                    ends = last or aimed
                    if aimed and not last:  # what is asked for at its end is written there
                        upto = written[lane]
                        while upto < row.size and row[upto] == row[written[lane]]:
                            upto += 1
                        only = row[:upto]
                    else:
                        only = row
                    written[lane] = write(
                        lane, n, only, written[lane], t[lane], step, ends, x, y, k,
                        out[begun + lane],
                    )  # fmt: skip
                    for c in range(n):
                        x[c * LANES + lane] = y[c * LANES + lane]
                    if fell[lane] != 0.0:
                        change = min(change, 1.0)
                    fell[lane] = 0.0
                    # A step that was cut short says little of the next one.
                    if abs(step * change) > abs(h[lane]) or abs(step) >= abs(h[lane]):
                        h[lane] = step * change
                    t[lane] = end[lane] if last else t[lane] + step
                    if aimed and not last:
                        t[lane] = row[written[lane] - 1]
                    if last:
                        state[lane] = ARRIVED
                if state[lane] == RUNNING:
                    slack = 1.0 + SLOWER * TRIAL / taken[lane]
                    gone = abs(t[lane] - start) * most * slack
                    slow = taken[lane] >= TRIAL and gone < abs(end[lane] - start) * taken[lane]
                    if taken[lane] >= most or slow:
                        state[lane] = EXHAUSTED
        for lane in range(own):
            cell = begun + lane
            status[cell], steps[cell] = state[lane], taken[lane]
            for i in range(written[lane], out.shape[1]):
                for c in range(n):
                    out[cell, i, c] = np.nan
            if state[lane] == FAILED:
                for c in range(n):
                    out[cell, out.shape[1] - 1, c] = x[c * LANES + lane]
