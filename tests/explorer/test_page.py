"""The page as a file: whole, of one piece, closed to what a user writes. No browser is needed."""

from __future__ import annotations

import base64
import functools
import hashlib
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest
import sympy as sp

import phasekit as pk
from phasekit.cli import main
from phasekit.explorer import javascript
from phasekit.systems.problem import as_problem
from phasekit.systems.registry import models

DISK = pk.GyroRotorDisk(beta=0.7, e=0.05, a=0.024, r=0.2, omega1=31.4)
SYSTEMS = {
    "disk": DISK,
    "loaded disk": DISK.replace(m=2.0, half_span=0.15),
    "reduced": pk.Reduced(lam=0.4, psi=0.1),
    "coefficients": pk.Coefficients(0.0, 0.0, 0.0),
    "particle": pk.ParticleOnCircle(radius=0.3, omega=5.0),
    "pendulum": pk.Pendulum(length=0.5),
    "magnet": pk.StonerWohlfarth(K=1.0, h_x=0.2, h_y=0.1),
    "well": pk.Potential("x^4/4 - mu*x^2/2", "x", {"mu": 1.0}),
    "bare": pk.Potential("x^2/2", "x"),
    "circle": pk.Potential("-cos(q) + b*cos(2*q)", "q", {"b": 0.5}, period="2*pi"),
}
EQUATIONS = {
    "planar": pk.Problem(
        {"v": "v - v^3/3 - w + I", "w": "eps*(v + a - b*w)"},
        parameters={"I": 0.5, "eps": 0.08, "a": 0.7, "b": 0.8},
        window={"v": (-2.5, 2.5), "w": (-1.0, 2.0)},
    ),
    "three states": pk.Problem(
        {"x": "s*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"},
        parameters={"s": 10.0, "r": 28.0, "b": 8 / 3},
        window={"x": (-25, 25), "y": (-30, 30), "z": (0, 60)},
    ),
    "line": pk.Problem("x - x^3", "x", window={"x": (-2, 2)}),
    "map": pk.Problem("r*x*(1 - x)", "x", {"r": 3.2}, map=True, window={"x": (0, 1)}),
    "forced": pk.Problem(
        {"x": "v", "v": "F*cos(w*t) - d*v + x - x^3"},
        parameters={"F": 0.3, "d": 0.2, "w": 1.0},
        time="t", period="2*pi/w", window={"x": (-2, 2), "v": (-2, 2)},
    ),
    "cylinder": pk.Perturbed(pk.Pendulum(length=0.5), damping=0.3, torque=2.0),
}  # fmt: skip
SYSTEMS |= EQUATIONS
VOID = {"meta", "link", "input", "br", "hr", "img"}


class Reader(HTMLParser):
    """Tags that close in order, attributes, and the text of scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.raw: list[tuple[str, dict[str, str | None], str]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)
        if tag in ("script", "style"):
            self.raw.append((tag, dict(attrs), ""))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("script", "style"):
            tag, attrs, text = self.raw[-1]
            self.raw[-1] = tag, attrs, text + data


def facts(text: str) -> dict:
    (found,) = (
        raw for tag, attrs, raw in Reader(text).raw if attrs.get("type") == "application/json"
    )
    return json.loads(found)


@functools.cache
def page_of(name: str) -> str:
    return pk.explore(SYSTEMS[name]).html


@pytest.mark.slow
@pytest.mark.parametrize("name", SYSTEMS)
def test_a_page_is_whole_and_asks_for_nothing(name):
    text = page_of(name)
    read = Reader(text)
    assert read.open == []
    assert len(read.tags) > 60
    assert "://" not in text
    for _, attrs in read.tags:
        assert not {"src", "srcset", "action"} & set(attrs)
        assert attrs.get("href", "data:,") == "data:,"
        assert not any(key.startswith("on") or key == "style" for key in attrs)
    for never in ("import(", "fetch(", "XMLHttpRequest", "WebSocket", "eval(", "new Function"):
        assert never not in text
    assert "@import" not in text
    assert "url(" not in text


@pytest.mark.slow
@pytest.mark.parametrize("name", SYSTEMS)
def test_the_policy_allows_this_script_and_this_style_alone(name):
    read = Reader(page_of(name))
    (policy,) = (
        attrs["content"] for tag, attrs in read.tags if "http-equiv" in attrs and tag == "meta"
    )
    assert policy.startswith("default-src 'none'; ")
    for tag, attrs, text in read.raw:
        if attrs.get("type") != "application/json":
            digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
            assert f"{tag}-src 'sha256-{digest}'" in policy
    assert "unsafe" not in policy


@pytest.mark.parametrize("name", SYSTEMS)
def test_all_parameters_are_there_with_units_and_values(name):
    system = SYSTEMS[name]
    given = facts(page_of(name))
    system = as_problem(system) if name in EQUATIONS else system
    assert [one["name"] for one in given["parameters"]] == [p.name for p in system.declared]
    for one, parameter in zip(given["parameters"], system.declared, strict=True):
        value = system.parameters.get(parameter.name)
        assert one["value"] == value
        assert one["units"] == ("" if parameter.units == "1" else parameter.units)
        assert one["low"] < one["high"]
        assert parameter.valid(np.array([one["low"], one["high"]])).all()
        assert value is None or one["low"] <= value <= one["high"]


def test_every_control_has_a_name_and_every_name_a_place():
    read = Reader(pk.explore(DISK).html)
    ids = [attrs["id"] for _, attrs in read.tags if "id" in attrs]
    assert len(ids) == len(set(ids)) > 30
    for _, attrs in read.tags:
        for key in ("for", "aria-labelledby", "aria-describedby"):
            assert set((attrs.get(key) or "").split()) <= set(ids)
    canvases = [attrs for tag, attrs in read.tags if tag == "canvas"]
    told = [attrs for attrs in canvases if attrs.get("aria-hidden") != "true"]
    assert len(told) == 7
    assert [attrs["id"] for attrs in canvases if attrs not in told] == ["dot"]
    assert all("aria-labelledby" in attrs and "role" in attrs for attrs in told)
    assert dict(read.tags)["html"] == {"lang": "en"}


HOSTILE = ["</script><script>alert(1)</script>", "x</textarea><b>", "a&lt;b", "'\"`${alert(1)}"]


def test_what_a_user_writes_is_text_and_never_code():
    """Names cannot be other than names, so that a hostile one comes by a class of one's own."""
    from phasekit.explorer import page

    for text in HOSTILE:
        assert json.loads(page.data({text: text})) == {text: text}
        assert not set("<>&") & set(page.data({text: text}))
        with pytest.raises(pk.ParameterError):
            pk.Potential("x^2", text)
        with pytest.raises(pk.ParameterError):
            pk.Potential(text, "x")
    names = ["constructor", "document", "p", "t0", "special", "Math", "lambda_1", "ψ"]
    formula = " + ".join(f"{name}*x^{i + 2}" for i, name in enumerate(names))
    system = pk.Potential(formula, "x", {name: 1.0 for name in names})
    (law,) = re.findall(r"const LAW = (\{.*?\n.*?loads: null\});", pk.explore(system).html, re.S)
    assert not set(re.findall(r"[A-Za-zψ_]\w*", law)) & {"constructor", "document", "ψ", "lambda_1"}


def test_numbers_and_functions_are_printed_so_that_they_mean_the_same():
    x, a = sp.symbols("x a", real=True)
    names = {x: "x", a: "p[0]"}
    expressions = [
        -(x**2) / 3 + a**-2, sp.sqrt(x**2 + 1) / (a - x) ** 3, (-x) ** 3 * -a, 2**x, x**a,
        sp.exp(-x) * sp.E, sp.Float(-2.5e-300) * x, sp.Rational(2**60, 3) * x, -(x + a) * (x - a),
        sp.Abs(x - 1) + sp.Max(x, a, 0.3),
        sp.atan2(x, -a) - sp.pi, 1 / x / a, x ** sp.Rational(3, 2), (x - 1) ** 7, -1 / (-x),
    ]  # fmt: skip
    space = {"x": 0.37, "p": [1.9]}
    for expression in expressions:
        text = javascript.write(expression, names)
        wants = float(expression.subs({x: 0.37, a: 1.9}))
        assert python_of(text, space) == pytest.approx(wants, rel=1e-14), text


def python_of(text, space):
    """The value of the small part of JavaScript that is printed, by Python."""
    import math

    class Math:
        abs, max, min = abs, max, min
        sin, cos, exp, sqrt, atan2, pow = (
            math.sin, math.cos, math.exp, math.sqrt, math.atan2, math.pow,
        )  # fmt: skip

    class special:  # noqa: N801
        power = staticmethod(pow)

    return float(eval(text, {"Math": Math, "special": special, **space}))  # noqa: S307


@pytest.mark.parametrize(
    ("system", "says"),
    [
        (DISK.replace(beta=[0.1, 0.2]), "system: got array parameters \\(beta\\)"),
        (pk.Potential("cos(x)", "x"), "interval: got None"),
        (pk.Potential("besselj(1/2, x)", "x", interval=(1, 2)), "wants a whole order"),
        ((1.0, 2.0, 3.0), "three coefficients make one"),
        (pk.Pendulum, "it is a class"),
        (pk.FreeGyroRotor(DISK.replace(m=1.0), 0.1), "window: got None, wants a range of dphi"),
        (None, "system: got None"),
    ],
)
def test_what_has_no_page_is_refused_by_its_name(system, says):
    with pytest.raises(pk.ParameterError, match=says):
        pk.explore(system)


def test_it_is_saved_shown_and_says_what_it_is(tmp_path):
    shown = pk.explore(DISK)
    assert repr(shown).startswith("Explorer of GyroRotorDisk(beta=0.7, ")
    path = shown.save(tmp_path / "disk.html")
    assert path.read_text(encoding="utf-8") == shown.html
    frame = shown._repr_html_()
    (attrs,) = (attrs for tag, attrs in Reader(frame).tags if tag == "iframe")
    assert attrs["srcdoc"] == shown.html
    for wrong in ("disk.png", tmp_path / "none" / "disk.html", 3):
        with pytest.raises(pk.PhasekitError, match="path: "):
            shown.save(wrong)


def test_the_same_system_has_the_same_page():
    assert pk.explore(DISK).html == pk.explore(DISK.replace()).html


# ---------------------------------------------------------------- command line


@pytest.fixture
def opened(monkeypatch):
    """Addresses that were given to the browser of this machine."""
    found = []
    monkeypatch.setattr("webbrowser.open", lambda url: found.append(url) or True)
    return found


def test_the_command_writes_a_page_and_opens_it(tmp_path, opened, capsys):
    path = tmp_path / "disk.html"
    words = ["--beta", "40deg", "--e", "50mm", "--a", "-24mm", "--r", "0.2", "--omega1", "300rpm"]
    assert main(["explore", *words, "--output", str(path), "--no-open"]) == 0
    assert opened == []
    beta = facts(path.read_text(encoding="utf-8"))["parameters"][0]
    assert beta["value"] == pytest.approx(40 * pk.deg)
    assert main(["explore", *words, "--output", str(path)]) == 2
    assert "exists" in capsys.readouterr().err
    assert main(["explore", "--output", str(path), "--overwrite"]) == 0
    assert opened == [path.as_uri()]


def test_the_command_shows_any_system_and_any_potential(tmp_path, opened, capsys):
    path = tmp_path / "page.html"
    common = ["--output", str(path), "--overwrite", "--no-open"]
    words = ["--model", "Pendulum", "--length", "1m"]
    assert main(["explore", *words, *common]) == 0
    assert facts(path.read_text(encoding="utf-8"))["model"] == "Pendulum"
    words = ["--potential", "x^4/4 - mu*x^2/2", "--parameter", "mu=-1.5"]
    assert main(["explore", *words, *common]) == 0
    assert facts(path.read_text(encoding="utf-8"))["parameters"][0]["value"] == -1.5
    words = ["--potential", "cos(q)", "--coordinate", "q", "--interval", "-1:4"]
    assert main(["explore", *words, *common]) == 0
    capsys.readouterr()
    for words, says in (
        (["--potential", "cos(q)"], "q"),
        (["--potential", "x^2", "--parameter", "mu"], "NAME=VALUE"),
        (["--potential", "x^2", "--interval", "3"], "LOW:HIGH"),
        (["--beta", "0:1:3", "--e", "1", "--a", "1", "--r", "1", "--omega1", "1"], "range"),
    ):
        assert main(["explore", *words, *common]) == 2
        assert says in capsys.readouterr().err


@pytest.mark.slow
def test_the_command_line_knows_every_model(capsys):
    """In a process of its own, for here everything is imported already."""
    import subprocess
    import sys

    code = "from phasekit.cli import common; print(*common.model_called('Pendulum').__mro__[:1])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "Pendulum" in done.stdout
    assert {"GyroRotorDisk", "Pendulum", "Potential"} <= set(models())
