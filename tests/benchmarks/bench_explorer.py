"""The page of the explorer: processor time from a slider to the picture, in a browser.

Run with ``pytest tests/benchmarks/bench_explorer.py``; the table is printed. The times are those
that Linux counts for the thread that draws the page.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from explorer.browser import Browser, installed

import phasekit as pk

DISK = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=31.4, m=2.0, half_span=0.15)
WELL = pk.Potential("x^4/4 - mu*x^2/2 + c*x", "x", {"mu": 1.0, "c": 0.1})
CIRCLE = pk.Potential("-cos(q) + b*cos(2*q)", "q", {"b": 0.5}, period="2*pi")
FITZHUGH_NAGUMO = pk.Problem(
    {"v": "v - v^3/3 - w + I", "w": "eps*(v + a - b*w)"},
    parameters={"I": 0.5, "eps": 0.08, "a": 0.7, "b": 0.8},
    window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)},
)
VAN_DER_POL = pk.Problem(
    {"x": "y", "y": "mu*(1 - x^2)*y - x"}, parameters={"mu": 1.0},
    window={"x": (-3, 3), "y": (-4, 4)},
)  # fmt: skip
DUFFING = pk.Problem(
    {"x": "v", "v": "F*cos(w*t) - d*v + x - x^3"}, parameters={"F": 0.3, "d": 0.2, "w": 1.2},
    time="t", period="2*pi/w", window={"x": (-2, 2), "v": (-2, 2)},
)  # fmt: skip
STATES = {"at rest": "", "damped": "&damping=0.3", "with a torque": "&torque=0.05"}
FOUR = "motions=0.3_0.2~1_1~-1_0~2_1"
PAGES = {
    **{
        f"{name}, {state}": (system, f"orbits=0.5_0.3~1_0.2{link}")
        for name, system in {"disk": DISK, "double well": WELL, "circle": CIRCLE}.items()
        for state, link in STATES.items()
    },
    "FitzHugh and Nagumo": (FITZHUGH_NAGUMO, ""),
    "van der Pol": (VAN_DER_POL, ""),
    "van der Pol, four motions": (VAN_DER_POL, FOUR),
    "van der Pol, stiff": (VAN_DER_POL.replace(mu=1000.0), ""),
    "Duffing, forced": (DUFFING, ""),
    "Duffing, four motions": (DUFFING, FOUR),
}
MOVES = 60


def drawing_thread(page: Browser) -> Path:
    """The counter of the thread that computes when the page does."""

    def spent() -> dict[Path, int]:
        found = {}
        for path in Path("/proc").glob("[0-9]*/cmdline"):
            if b"--type=renderer" in path.read_bytes() and page.folder.name.encode() in (
                path.read_bytes()
            ):
                one = path.parent / "schedstat"
                found[one] = int(one.read_text().split()[0])
        return found

    before = spent()
    page.run("(() => { let s = 0; for (let i = 0; i < 3e7; i++) s += Math.sqrt(i); return s; })()")
    after = spent()
    return max(after, key=lambda one: after[one] - before.get(one, 0))


def moves(page: Browser) -> list[float]:
    """Processor times of moves of the first slider, in ms and in order."""
    counter = drawing_thread(page)
    times = []
    for i in range(MOVES):
        page.run(
            "(() => { window.slider = document.querySelector('.slider input[type=range]');"
            f" slider.value = {210 + 10 * i}; }})()"
        )
        before = int(counter.read_text().split()[0])
        page.run("slider.dispatchEvent(new Event('input'))")
        times.append((int(counter.read_text().split()[0]) - before) / 1e6)
        page.run("new Promise(requestAnimationFrame)")
    return sorted(times)


@pytest.mark.skipif(installed() is None, reason="no chromium on this machine")
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_time_from_slider_to_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = {}
    for name, (system, link) in PAGES.items():
        page = Browser(str(installed()))
        try:
            path = pk.explore(system).save(tmp_path / "page.html")
            page.open(f"{path.as_uri()}#{link}")
            page.until("!document.body.classList.contains('searching')", wait=60)
            rows[name] = moves(page)
        finally:
            page.close()
    assert len(rows) == 15
    with capsys.disabled():
        print(f"\nms of processor time, of {MOVES} moves: least, median, 95th of 100")
        for name, times in rows.items():
            shown = (times[0], times[MOVES // 2], times[int(0.95 * MOVES)])
            print(f"{name:<28}" + "".join(f"{value:8.1f}" for value in shown))
