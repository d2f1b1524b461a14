from __future__ import annotations

import enum
import functools
import gc
import os
import re
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from jinja2.sandbox import SandboxedEnvironment
from numpydoc import docscrape_sphinx
from sphinx.jinja2glue import BuiltinTemplateLoader

import phasekit

sys.path.insert(0, str(Path(__file__).parent))
import doors  # noqa: E402
import study_run  # noqa: E402
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
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "sphinx-mathjax-offline",  # formulas are set without any other host
]
exclude_patterns = [
    "_build",
    "jupyter_execute",
    "**/sg_execution_times.rst",
    "sg_execution_times.rst",
    "gallery/**/*.ipynb",
]
# The list of references stands even where no docstring cites an entry.
suppress_warnings = ["ref.citation"]

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
os.environ.pop("MPLBACKEND", None)  # else notebooks would show no pictures
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_output_stderr = "remove"  # progress bars, and that something is compiled

autosummary_generate = True
templates_path = ["_templates"]
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False

# numpydoc makes a loader and compiles its template for each docstring, of which there are a
# thousand; both are the same each time.
docscrape_sphinx.BuiltinTemplateLoader = functools.cache(BuiltinTemplateLoader)
docscrape_sphinx.SandboxedEnvironment = functools.cache(SandboxedEnvironment)
# Pages are trees of millions of nodes that stay: collections look through all of them in vain.
gc.freeze()
gc.set_threshold(50_000, 50, 50)

_here = Path(__file__).parent

sphinx_gallery_conf = {
    "examples_dirs": "../studies",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "ignore_pattern": r"^(picture|veljovic2015|hedrih_veljovic|hedrih_veljovic_hodographs)\.py$",
    "subsection_order": ["../studies/questions", "../studies/figures"],
    "within_subsection_order": "FileNameSortKey",
    "reset_argv": "study_run.argv",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "show_signature": False,
    "plot_gallery": True,
}

# Pictures of the start page, and pages of the explorer as `pk.explore(...).save(...)` writes them.
_disk = phasekit.GyroRotorDisk(
    beta=40 * phasekit.deg, e=0.05, a=0.024, r=0.2, omega1=300 * phasekit.rpm, m=2.0, half_span=0.15
)
(_here / "auto_explorer").mkdir(exist_ok=True)
doors.write(_here / "auto_explorer")
phasekit.explore(_disk).save(_here / "auto_explorer" / "explorer_page.html")
_neuron = phasekit.Problem(
    {"v": "v - v^3/3 - w + I", "w": "eps*(v + a - b*w)"},
    parameters={"I": 0.5, "eps": 0.08, "a": 0.7, "b": 0.8},
    window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)},
)
phasekit.explore(_neuron, over=[("I", "eps"), ("I", "b")], ranges={"I": (0, 2)}).save(
    _here / "auto_explorer" / "explorer_equations.html"
)

html_theme = "pydata_sphinx_theme"
html_title = "phasekit"
html_static_path = ["_static", "auto_explorer"]
html_css_files = ["site.css"]
html_js_files = ["copy.js", "tables.js"]
html_theme_options = {"show_prev_next": False, "navigation_with_keys": False}

default_role = "py:obj"  # `flow` in a docstring leads to its page

_papers = re.findall(
    r"^\.\. \[(\w+)\]", (_here / "references.md").read_text(encoding="utf-8"), re.MULTILINE
)
_cited = re.compile(rf"\[({'|'.join(_papers)})\](?!_)")


def _link_papers(app: Any, what: str, name: str, thing: Any, options: Any, lines: Any) -> None:
    """Make links of the keys of papers in docstrings, outside examples and code."""
    for i, line in enumerate(lines):
        if not line.lstrip().startswith((">>>", "...")) and "``" not in line and "'" not in line:
            lines[i] = _cited.sub(r"[\1]_", line)


#: Tables that the classes of systems hold for phasekit itself.
_TABLES = {"declared", "critical_values", "rung"}


def _skip(app: Any, what: str, name: str, thing: Any, skip: bool, options: Any) -> bool | None:
    """Leave out tables and fields, which stand among the parameters; keep codes."""
    if isinstance(thing, enum.Enum):
        return False
    return True if name in _TABLES or type(thing).__name__ == "_tuplegetter" else None


def _leave_out_waits(app: Any, page: nodes.document) -> None:
    """Leave out what cells print to somebody who waits, which depends on the machine."""
    for block in list(page.findall(nodes.literal_block)):
        if not {"stream", "sphx-glr-script-out"} & {*block["classes"], *block.parent["classes"]}:
            continue
        lines = block.astext().splitlines()
        kept = [line for line in lines if not line.startswith("phasekit: ")]
        if not kept:
            block.parent.remove(block)
        elif kept != lines:
            block.rawsource = "\n".join(kept)
            block[:] = [nodes.Text(block.rawsource)]


def setup(app: Any) -> None:
    """Look at docstrings before numpydoc does, at members, at outputs, and at studies' words."""
    app.connect("autodoc-process-docstring", _link_papers, priority=400)
    app.connect("autodoc-skip-member", _skip)
    app.connect("source-read", study_run.named)
    app.connect("doctree-read", _leave_out_waits)


# Quantities, systems, special points and codes have pages that are made of the code.
tables.write(_here / "generated")
