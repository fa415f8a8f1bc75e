"""The documentation site: ``python -m sphinx -W --keep-going docs build/site``; README.md is for code hosts.

It works offline: fonts, search and formulas are in the site itself.
"""

import os
import sys
from importlib.metadata import files
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent), str(DOCS / "extensions")]

from jupyter_client import KernelManager  # noqa: E402

import kratos_lite  # noqa: E402

if hasattr(KernelManager, "transport_encryption"):  # without, each notebook warns of it
    KernelManager.transport_encryption.default_value = "auto"
os.environ["KRATOS_LITE_PROGRESS"] = "off"  # pages show what stays, not what passes

project = "kratos_lite"
author = "The kratos_lite developers"
copyright = "The kratos_lite developers, BSD-3-Clause"
version = release = kratos_lite.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "sphinx_design",
    "command_line",
    "docstrings",
    "browser_pages",
    "gallery",
    "known_words",
    "public_names",
    "search_texts",
]
exclude_patterns = ["_static", "extensions", "images"]
nitpicky = True

# ---- pages and notebooks ---------------------------------------------------------------------------

myst_enable_extensions = ["amsmath", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_execution_show_tb = True
nb_merge_streams = True
nb_ipywidgets_js = {}

# ---- reference -------------------------------------------------------------------------------------

autodoc_member_order = "bysource"
autodoc_typehints = "none"
autosummary_generate = False
default_role = "py:obj"
nitpick_ignore_regex = [("py:obj", ".*")]
python_use_unqualified_type_names = True
toc_object_entries_show_parents = "hide"

# ---- look ------------------------------------------------------------------------------------------

html_theme = "pydata_sphinx_theme"
html_title = "kratos_lite"
html_favicon = "_static/mark.svg"
html_theme_options = {
    "logo": {"text": "kratos_lite", "image_light": "_static/mark.svg", "image_dark": "_static/mark.svg"},
    "navbar_align": "left",
    "header_links_before_dropdown": 7,
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_copy_source = False
html_show_sourcelink = False
html_context = {"default_mode": "auto"}
mathjax_path = "tex-svg-full.js"
_mathjax = next(file for file in files("sphinx-mathjax-offline") or [] if file.name == mathjax_path)
html_static_path = ["_static", str(_mathjax.locate())]
html_css_files = ["site.css"]
html_search_scorer = str(DOCS / "extensions" / "scorer.js")

# ---- links to other sites: python -m sphinx -b linkcheck docs build/links --------------------------

linkcheck_timeout = 20
linkcheck_retries = 2
linkcheck_anchors = False
