"""Texts in vector files stay texts, which can be edited."""

import re

import pytest

import phasekit as pk
from phasekit.cli import common


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["svg", "pdf"])
def test_texts_stay_texts(tmp_path, kind):
    path = tmp_path / f"portrait.{kind}"
    common.save(pk.plot.phase_portrait(pk.Reduced(0.4, 0.1)), path)
    found = path.read_bytes()
    if kind == "svg":
        assert re.search(rb"<text[^>]*>winding separatrix</text>", found)
    else:
        assert b"/FontFile2" in found or b"/TrueType" in found
        assert b"/Type3" not in found
