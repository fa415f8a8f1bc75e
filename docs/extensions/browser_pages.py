"""Pages for the browser in the site: what the Python of their how-to writes, shown in it.

The directive ``browser-page`` names one of the files.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html import escape
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).resolve().parents[2]
HOW_TO = ROOT / "docs" / "howto" / "browser-page.md"
HOME = "_static/pages"


def setup(app: Any) -> dict[str, bool]:
    """Register the directive, and write the pages at the start."""
    app.add_directive("browser-page", BrowserPage)
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True}


def write_pages(app: Any) -> None:
    """Run the Python of the how-to where the site keeps its files."""
    if app.builder.format != "html":
        return
    blocks = re.findall(r"^```python\n(.*?)^```", HOW_TO.read_text(encoding="utf-8"), re.M | re.S)
    home = Path(app.outdir) / HOME
    home.mkdir(parents=True, exist_ok=True)
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    words = [sys.executable, "-c", "\n".join(blocks)]
    done = subprocess.run(words, cwd=home, env=env, capture_output=True, encoding="utf-8", check=False)
    if done.returncode:
        raise ExtensionError(f"{HOW_TO.name}: its Python ends with {done.returncode}\n{done.stderr}")


class BrowserPage(SphinxDirective):
    """Show a page by its file, a title beneath."""

    required_arguments = 1
    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return a frame that loads the page when it is scrolled to."""
        depth = self.env.docname.count("/")
        source, title = f"{'../' * depth}{HOME}/{self.arguments[0]}", escape(" ".join(self.content))
        style = "width: 100%; height: 32rem; border: 1px solid #8886; border-radius: 6px"
        frame = f'<iframe src="{source}" title="{title}" loading="lazy" style="{style}"></iframe>'
        return [nodes.raw("", frame, format="html")]
