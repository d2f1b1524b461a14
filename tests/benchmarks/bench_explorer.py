"""The page of the explorer: time from a slider to the picture, in a browser.

Run with ``pytest tests/benchmarks/bench_explorer.py``; the table is printed.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from explorer.browser import Browser, installed

import phasekit as pk

SYSTEMS = {
    "disk": pk.GyroRotorDisk(
        beta=0.7, e=0.05, a=0.024, r=0.2, omega1=31.4, m=2.0, half_span=0.15
    ),
    "double well": pk.Potential("x^4/4 - mu*x^2/2 + c*x", "x", {"mu": 1.0, "c": 0.1}),
    "circle": pk.Potential("-cos(q) + b*cos(2*q)", "q", {"b": 0.5}, period="2*pi"),
}  # fmt: skip
STATES = {"at rest": "", "damped": "&damping=0.3", "with a torque": "&torque=0.05"}
DRAG = """
(async () => {
  const times = [];
  const slider = document.querySelector(".slider input[type=range]");
  for (let i = 0; i < 60; i++) {
    slider.value = 200 + 10 * i;
    const start = performance.now();
    slider.dispatchEvent(new Event("input"));
    times.push(performance.now() - start);
    await new Promise(requestAnimationFrame);
  }
  times.sort((a, b) => a - b);
  return [times[0], times[30], times[57]];
})()
"""


@pytest.mark.skipif(installed() is None, reason="no chromium on this machine")
def test_time_from_slider_to_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    browser = Browser(str(installed()))
    rows = {}
    try:
        for name, system in SYSTEMS.items():
            path = pk.explore(system).save(tmp_path / f"{name}.html")
            for state, link in STATES.items():
                browser.open(f"{path.as_uri()}#orbits=0.5_0.3~1_0.2{link}")
                rows[f"{name}, {state}"] = browser.run(DRAG)
    finally:
        browser.close()
    assert len(rows) == 9
    with capsys.disabled():
        print("\nmilliseconds, of 60 moves: least, median, 95th of 100")
        for name, times in rows.items():
            print(f"{name:<28}" + "".join(f"{value:8.1f}" for value in times))
