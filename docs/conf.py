from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import phasekit

sys.path.insert(0, str(Path(__file__).parent))
import tables  # noqa: E402

project = "phasekit"
author = "phasekit developers"
copyright = "2026, phasekit developers"
release = version = phasekit.__version__

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
]
exclude_patterns = ["_build", "jupyter_execute"]
# The list of references stands even where no docstring cites an entry.
suppress_warnings = ["ref.citation"]

myst_enable_extensions = ["amsmath", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300

autosummary_generate = True
templates_path = ["_templates"]
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

# The pictures of the studies are made here, so that none can be out of date.
_here = Path(__file__).parent
(_here / "auto_studies").mkdir(exist_ok=True)
for _study in sorted(_here.parent.glob("studies/*.py")):
    if "__main__" not in _study.read_text(encoding="utf-8"):
        continue  # what the studies have in common
    _picture = _here / "auto_studies" / f"{_study.stem}.png"
    _command = [sys.executable, str(_study), str(_picture)]
    subprocess.run(_command, check=True, stdout=subprocess.DEVNULL)

# A page of the explorer, as `pk.explore(...).save(...)` writes it.
_disk = phasekit.GyroRotorDisk(
    beta=40 * phasekit.deg, e=0.05, a=0.024, r=0.2, omega1=300 * phasekit.rpm, m=2.0, half_span=0.15
)
(_here / "auto_explorer").mkdir(exist_ok=True)
phasekit.explore(_disk).save(_here / "auto_explorer" / "explorer_page.html")

html_theme = "pydata_sphinx_theme"
html_title = "phasekit"
html_static_path = ["_static", "auto_explorer"]
html_theme_options = {"show_prev_next": False, "navigation_with_keys": False}

# Quantities, systems, special points and codes have pages that are made of the code.
tables.write(_here / "generated")
