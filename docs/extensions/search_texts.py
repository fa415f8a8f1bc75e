"""Texts of hits of the search, also without a server: browsers let no script read the pages of ``file://``.

What the search asks for with ``fetch`` stands in a script instead: the sections of all pages and their texts.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

NAME = "search_texts.js"
SCRIPT = """const TEXTS = {};
const ask = window.fetch;
window.fetch = (page) => page in TEXTS ? Promise.resolve(new Response(TEXTS[page])) : ask(page);
"""


def setup(app: Any) -> dict[str, bool]:
    """Write the script when all pages are there, and let the page of the search load it."""
    app.connect("html-page-context", load)
    app.connect("build-finished", write)
    return {"parallel_read_safe": True}


def load(app: Any, page: str, template: str, context: Any, doctree: Any) -> None:
    """Let the page of the search load the script."""
    if page == "search":
        app.add_js_file(NAME)


def write(app: Any, error: Exception | None) -> None:
    """Write the texts by the addresses that the search asks for."""
    if error or app.builder.format != "html":
        return
    home = Path(app.outdir)
    pages = {name: home / f"{name}.html" for name in sorted(app.env.found_docs)}
    texts = {f"./{name}.html": text_of(path.read_text(encoding="utf-8")) for name, path in pages.items()}
    script = SCRIPT.replace("{}", json.dumps(texts, ensure_ascii=False), 1)
    (home / "_static" / NAME).write_text(script, encoding="utf-8")


def text_of(page: str) -> str:
    """Return what a page says: its sections, and nothing else of its HTML.

    >>> text_of('<p>x<article><section id="a"><h1>A<a class="headerlink">#</a></h1>b</section></article>')
    '<main role="main"><section id="a">Ab</section></main>'
    """
    article = re.search(r"<article[^>]*>(.*)</article>", page, re.S)
    body = re.sub(r'<a class="headerlink".*?</a>', "", article[1] if article else "", flags=re.S)
    return f'<main role="main">{re.sub(r"<(?!/?section)[^>]*>", "", body)}</main>'
