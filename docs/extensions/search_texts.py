"""Texts of hits of the search, also without a server: browsers let no script read the pages of ``file://``.

What the search asks for with ``fetch`` stands in a script instead: the sections of all pages and their texts,
and to which pages that of words leads.  An excerpt begins at the query as it is written, if it is there.
"""

from __future__ import annotations

import html
import json
import re
import unicodedata
from pathlib import Path
from typing import Any

NAME = "search_texts.js"
SCRIPT = """const TEXTS = {texts};
const WORDS = {words};
const ask = window.fetch;
window.fetch = (page) => page in TEXTS ? Promise.resolve(new Response(TEXTS[page])) : ask(page);
window.addEventListener("DOMContentLoaded", () => {
  const excerpt = Search.makeSearchSummary;
  const query = new URLSearchParams(window.location.search).get("q") || "";
  Search.makeSearchSummary = (page, words, anchor) => excerpt(page, [...words, query], anchor);
});
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
    words = words_of(pages["reference/words"].read_text(encoding="utf-8"))
    script = SCRIPT.replace("{words}", json.dumps(words, ensure_ascii=False), 1)
    script = script.replace("{texts}", json.dumps(texts, ensure_ascii=False), 1)
    (home / "_static" / NAME).write_text(script, encoding="utf-8")


def text_of(page: str) -> str:
    """Return what a page says: its sections, and nothing else of its HTML.

    >>> text_of('<p>x<article><section id="a"><h1>A<a class="headerlink">#</a></h1>b</section></article>')
    '<main role="main"><section id="a">Ab</section></main>'
    """
    article = re.search(r"<article[^>]*>(.*)</article>", page, re.S)
    body = re.sub(r'<a class="headerlink".*?</a>', "", article[1] if article else "", flags=re.S)
    body = re.sub(
        r'<(span|div) class="math [^>]*>(.*?)</\1>', lambda found: formula(found[2]), body, flags=re.S
    )
    text = re.sub(r"\s+", " ", re.sub(r"<(?!/?section)[^>]*>", "", body))
    return f'<main role="main">{text}</main>'


def formula(tex: str) -> str:
    r"""Return a formula in letters, or an ellipsis if it has more.

    >>> formula(r"\(\mathbf K_{ab}\)"), formula(r"\(\boldsymbol\varepsilon\)"), formula(r"\[\frac{1}{2}\]")
    ('K_ab', 'ε', '…')
    """
    plain = re.sub(r"\\([()\[\] ,]|mathbf|mathrm|boldsymbol|text)|[{}]", "", tex)
    try:
        plain = re.sub(r"\\([a-zA-Z]+) ?", lambda found: greek(found[1]), plain).strip()
    except KeyError:
        return "…"
    return "…" if "\\" in plain or "&" in plain else plain


def greek(name: str) -> str:
    """Return a Greek letter by its name in TeX; KeyError for other names."""
    size = "SMALL" if name.islower() else "CAPITAL"
    return unicodedata.lookup(
        f"GREEK {size} LETTER {name.upper().removeprefix('VAR').replace('LAMBDA', 'LAMDA')}"
    )


def words_of(page: str) -> dict[str, list[str]]:
    """Return the pages to which that of words leads, by each of its words.

    >>> words_of('<tr><td>RBE2, B–bar</td><td><a class="x" href="../topics/locking.html#a">b</a></td></tr>')
    {'rbe2': ['topics/locking'], 'b bar': ['topics/locking']}
    """
    found: dict[str, list[str]] = {}
    for row in re.findall(r"<tr.*?</tr>", page, re.S):
        words = html.unescape(re.sub("<[^>]*>", "", row.partition("</td>")[0]))
        pages = re.findall(r'href="(?:\.\./)?([^"#:]*)\.html', row)
        for word in words.split(","):
            found[re.sub(r"[\s–-]+", " ", word.lower()).strip()] = pages
    return found
