"""Where the picture of a study goes."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure


def save(figure: Figure) -> None:
    """Save a picture under the name given on the command line, else in the working folder."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(Path(sys.argv[0]).stem + ".png")
    # Texts of vector files stay texts, which can be edited.
    with plt.rc_context({"svg.fonttype": "none", "pdf.fonttype": 42}):
        figure.savefig(path, dpi=150)
    plt.close(figure)
    print(f"wrote {path}")
