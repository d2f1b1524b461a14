"""``phasekit demo``: map a real rotor over disk angle and axis distance, draw it, store it."""

from __future__ import annotations

import shlex
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

import phasekit as pk
from phasekit.cli import Parser, common
from phasekit.errors import StoreError, Topology

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# A disk of 200 mm whose mass center lies 50 mm from its shaft's point O2, on a carrier at 300 rpm.
ROTOR = pk.GyroRotorDisk(beta=30 * pk.deg, e=0.05, a=0.02, r=0.2, omega1=300 * pk.rpm)
BETA = np.linspace(0.0, 90.0, 91) * pk.deg
# Whole steps, so that the line a = 0 of the heteroclinic cycles is a row of the map.
A = np.arange(-50, 51) * 1.2e-3
# Cells whose portraits are drawn: beta (deg), a (mm).
CELLS = ((30.0, 0.0), (40.0, 24.0), (65.0, 30.0), (84.0, 12.0))


def run(argv: Sequence[str]) -> None:
    """Make the map, the picture and the store."""
    parser = Parser(
        prog="phasekit demo",
        description="Map the equilibria and separatrices of a rotor over the angle of its disk "
        "and the distance of its axes. Prints a summary, and writes a picture and the map.",
    )
    parser.add_argument("--out", default="phasekit-demo", help="folder to write to (%(default)s)")
    parser.add_argument(
        "--overwrite", action="store_true", help="replace what an earlier run wrote"
    )
    options = parser.parse_args(argv)
    folder = common.path_called("--out", options.out)
    picture, store = folder / "map.png", folder / "map.zarr"
    if folder.exists() and not folder.is_dir():
        raise StoreError(f"--out: {folder} is a file; choose another name")
    for path in (picture, store):
        if path.exists() and not options.overwrite:
            raise StoreError(f"--out: {path} exists; choose another folder or pass --overwrite")
    folder.mkdir(parents=True, exist_ok=True)

    common.say(
        "Rotor: r = 200 mm, e = 50 mm, omega1 = 300 rpm; "
        f"map: beta x a = {BETA.size} x {A.size} cells"
    )
    start = time.perf_counter()
    ds = pk.sweep(ROTOR, {"beta": BETA, "a": A}, store=store, overwrite=options.overwrite)
    common.say(f"computed and stored in {time.perf_counter() - start:.1f} s")
    summarize(ds)
    common.quiet_backend()
    common.save(draw(ds), picture, dpi=120)
    common.say(f"wrote {picture} and {store}")
    me, rotor = common.program(), "--e 50mm --r 200mm --omega1 300rpm"
    shown, one = shlex.quote(str(store)), folder / "portrait.png"
    common.say(
        f"""
next, try
  {me} explore --beta 40deg --a 24mm {rotor}
      explore this rotor with sliders, in the browser
  {me} portrait --beta 84deg --a 12mm {rotor} --angles deg --out {shlex.quote(str(one))}
      draw cell (d) alone
  {me} info {shown} --units beta=deg,a=mm,e=mm,r=mm,omega1=rpm
      see what the stored map holds; pk.open_map({str(store)!r}) opens it in Python"""
    )


def summarize(ds: xr.Dataset) -> None:
    """Print what the map holds and where its folds lie."""
    codes = ds["topology"].values
    for topology in (Topology.WINDING, Topology.FIGURE_EIGHT, Topology.HETEROCLINIC):
        share = np.count_nonzero(codes == topology)
        name = topology.name.lower().replace("_", "-")
        common.say(f"  {name:<13}{share:>6} cells  {100 * share / codes.size:5.1f} %")
    found = pk.critical(ROTOR, "beta")
    folds = " and ".join(f"{value / pk.deg:.4f}" for value in found["critical_fold"].values)
    common.say(
        f"at a = 20 mm the folds lie at beta = {folds} deg, "
        f"A changes sign at {float(found['critical_sign_change']) / pk.deg:.4f} deg"
    )


def draw(ds: xr.Dataset) -> Figure:
    """Draw the map with four cells marked, and their portraits beside it."""
    import matplotlib.pyplot as plt

    figure = plt.figure(figsize=(13.0, 6.4), layout="constrained")
    grid = figure.add_gridspec(1, 2, width_ratios=(1.05, 1.0))
    left = figure.add_subfigure(grid[0])
    right = figure.add_subfigure(grid[1])
    units = {"beta": "deg", "a": "mm"}
    ax = pk.plot.parameter_map(ds, "topology", units=units, ax=left.subplots())
    panels: list[Axes] = list(right.subplots(2, 2, sharex=True).flat)
    for letter, (beta, a), panel in zip("abcd", CELLS, panels, strict=True):
        ax.plot([beta], [a], marker="o", markersize=15, color="white", markeredgecolor="black")
        ax.annotate(letter, (beta, a), ha="center", va="center", color="black")
        cell = ds.sel(beta=beta * pk.deg, a=a * 1e-3, method="nearest")
        pk.plot.phase_portrait(cell.phasekit.system(), angles="deg", ax=panel, legend=False)
        panel.set_title(f"({letter})  β = {beta:g}°, a = {a:g} mm", fontsize="medium")
    handles: dict[str, Artist] = {}
    for panel in panels:
        handles |= dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
    right.legend(
        handles=handles.values(), loc="outside lower center", ncols=3, frameon=False, handlelength=3
    )
    for panel in panels[:2]:
        panel.set_xlabel("")
    for panel in panels[1::2]:
        panel.set_ylabel("")
    return figure
