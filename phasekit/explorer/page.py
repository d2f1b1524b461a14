"""The page of the explorer: one static file of markup, style, script and what it shows."""

from __future__ import annotations

import base64
import hashlib
import html
import json
from importlib import resources
from typing import Any

#: Scripts in the order in which they stand in the one script, before and after the law, of the page
#: of a system in a potential and of that of equations.
POTENTIAL = (
    ("numerics", "special"),
    (
        "drawing", "dynamics", "orbits", "panels", "exports", "parameters", "state", "controls",
        "basins", "playing", "machine", "taken", "words", "main",
    ),
)  # fmt: skip
EQUATIONS = (
    ("numerics", "special"),
    (
        "drawing", "flows", "cycles", "exports", "parameters", "flow_state", "controls",
        "basins", "playing", "flow_pictures", "flow_words", "flow_main",
    ),
)  # fmt: skip


def page(
    facts: dict[str, Any],
    law: str,
    scripts: tuple[tuple[str, ...], tuple[str, ...]] = POTENTIAL,
    markup: str = "page.html",
) -> str:
    """Return the page of one system as HTML.

    Nothing that a user wrote becomes markup or script: names, formulas and values stand in a
    block of JSON, which is shown as text; the law is printed by `phasekit.explorer.javascript`.
    The policy of the page allows this one script, by its hash, and no request.
    """
    style = asset("style.css")
    before_law, after_law = scripts
    script = "\n".join(
        (
            '"use strict";\n(() => {',
            *(asset(f"{name}.js") for name in before_law),
            f"const LAW = {law};",
            *(asset(f"{name}.js") for name in after_law),
            "})();",
        )
    )
    policy = (
        f"default-src 'none'; script-src {_hash(script)}; style-src {_hash(style)}; "
        "img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    parts = {
        "policy": policy,
        "title": html.escape(facts["model"]),
        "style": style,
        "facts": data(facts),
        "script": script,
    }
    before, *pieces = asset(markup).split("{{")
    text = [before]
    for piece in pieces:
        name, _, after = piece.partition("}}")
        text += [parts[name.strip()], after]
    return "".join(text)


def data(value: Any) -> str:
    r"""Write JSON that cannot end the block it stands in.

    >>> data("</script>")
    '"\\u003c/script\\u003e"'
    """
    text = json.dumps(value, ensure_ascii=True, allow_nan=False, sort_keys=True)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def asset(name: str) -> str:
    """Return the text of a file of the page."""
    return resources.files("phasekit.explorer").joinpath("assets", name).read_text("utf-8")


def _hash(text: str) -> str:
    digest = hashlib.sha256(text.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode()}'"
