"""Pages of examples: the directive ``example`` shows a script, its picture and what it prints.

``gallery`` shows thumbnails. What the pages of ``docs/gallery`` name runs once, before the pages are read.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from docutils.parsers.rst import directives
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES, PAGES = ROOT / "examples", ROOT / "docs" / "gallery"
STUB = re.compile(r"^# (?P<title>.*?)$.*?^```\{example\} (?P<file>\S+)\n(?P<rest>.*?)```", re.M | re.S)


def setup(app: Any) -> dict[str, bool]:
    """Register the directives, and run the examples at the start."""
    app.add_directive("example", Example)
    app.add_directive("gallery", Gallery)
    app.connect("builder-inited", run_all)
    return {"parallel_read_safe": True}


def folder(app: Any) -> Path:
    """Return where pictures and printed texts are kept until the pages are written."""
    return Path(app.doctreedir) / "gallery"


def run_all(app: Any) -> None:
    """Run every example, two at a time."""
    folder(app).mkdir(parents=True, exist_ok=True)
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda page: run(page, folder(app)), sorted(PAGES.glob("*.md"))))


def run(page: Path, out: Path) -> None:
    """Run the example of a page; keep its picture and what it prints."""
    found = STUB.search(page.read_text(encoding="utf-8"))
    if not found:
        return
    picture = out / f"{page.stem}.png"
    words = [str(picture) if word == "PICTURE" else word for word in command(**found.groupdict()).split()]
    words[:1] = [sys.executable] if words[0] == "python" else [sys.executable, "-m", "kratos_lite"]
    with TemporaryDirectory() as here:
        os.symlink(EXAMPLES, Path(here) / "examples", target_is_directory=True)
        env = os.environ | {"MPLBACKEND": "Agg", "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "utf-8"}
        done = subprocess.run(words, cwd=here, env=env, capture_output=True, encoding="utf-8", check=False)
    if done.returncode:
        raise ExtensionError(f"{page.name}: {' '.join(words)} ends with {done.returncode}\n{done.stderr}")
    printed = "\n".join(line for line in done.stdout.splitlines() if str(out) not in line)
    picture.with_suffix(".txt").write_text(printed, encoding="utf-8")


def command(file: str, rest: str, **more: str) -> str:
    """Return the line that runs an example, the option ``run`` if there is one."""
    line = re.search(r"^:run: (.*)$", rest, re.M)
    return line[1] if line else f"python examples/{file} PICTURE"


def head_of(file: str, rest: str) -> str:
    """Return the text at the head of an example, in the page or in the file."""
    own = re.sub(r"^:run: .*\n", "", rest).strip()
    return own or parts((EXAMPLES / file).read_text(encoding="utf-8"))[0]


def parts(text: str) -> tuple[str, list[tuple[str, str]]]:
    """Return the text at the head of an example, without its title, and its cells of code and text."""
    if "# %%" in text:
        cells = re.findall(r"^# %%( \[markdown\])?\n(.*?)(?=^# %%|\Z)", text, re.M | re.S)
        found = [("text", re.sub(r"(?m)^# ?", "", body)) if mark else ("code", body) for mark, body in cells]
        return re.sub(r"\A# .*\n", "", found[0][1]).strip(), found[1:]
    head = re.match(r'"""(.*?)"""|((?:(?:#|//).*\n)+)', text, re.S)
    words = re.sub(r"(?m)^(#|//) ?", "", head[1] or head[2]) if head else ""
    return words.replace("``", "`").strip(), [("code", text[head.end() if head else 0 :])]


class Example(SphinxDirective):
    """One example: its text, code, output and picture."""

    required_arguments = 1
    has_content = True
    option_spec = {"run": directives.unchanged}  # noqa: RUF012

    def run(self) -> list[Any]:
        """Return the nodes of the page."""
        file, name = self.arguments[0], Path(self.env.docname).name
        head, cells = parts((EXAMPLES / file).read_text(encoding="utf-8"))
        head = "\n".join(self.content) or head
        kept = folder(self.env.app) / f"{name}.png"
        language = {".py": "python", ".json": "js"}.get(Path(file).suffix, "text")
        lines = [head, "", *self.picture(kept)]
        for kind, body in cells:
            lines += ["", *([f"```{language}", body.strip(), "```"] if kind == "code" else [body])]
        shown = command(file, "".join(f":{key}: {text}" for key, text in self.options.items()))
        shown = shown.replace("PICTURE", f"{name}.png")
        printed = kept.with_suffix(".txt").read_text(encoding="utf-8")
        lines += ["", "```text", f"$ {shown}", printed.strip(), "```"]
        self.env.note_dependency(str(EXAMPLES / file))
        return self.parse_text_to_nodes("\n".join(lines))

    def picture(self, path: Path) -> list[str]:
        """Return the line of the picture, if there is one."""
        if not path.exists():
            return []
        return [f"![{path.stem}]({os.path.relpath(path, PAGES)}){{.example}}"]


class Gallery(SphinxDirective):
    """Thumbnails of all examples that the content names, each with its title and first sentence."""

    has_content = True

    def run(self) -> list[Any]:
        """Return a grid of cards."""
        lines = ["::::{grid} 1 2 3 3", ":gutter: 3", ""]
        for name in self.content:
            lines += self.card(name.strip())
        return self.parse_text_to_nodes("\n".join([*lines, "::::"]))

    def card(self, name: str) -> list[str]:
        """Return the card of one page."""
        found = STUB.search((PAGES / f"{name}.md").read_text(encoding="utf-8"))
        if not found:
            raise ExtensionError(f"docs/gallery/{name}.md names no example")
        head = head_of(found["file"], found["rest"])
        first = re.split(r"(?<=[.:])\s", " ".join(head.split()))[0].rstrip(":.") + "."
        path = folder(self.env.app) / f"{name}.png"
        image = [f":img-top: {os.path.relpath(path, PAGES)}"] if path.exists() else []
        card = [f":::{{grid-item-card}} {found['title']}", *image, f":link: {name}", ":link-type: doc"]
        return [*card, "", first, ":::", ""]
