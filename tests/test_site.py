"""The documentation site: every public name is there, and the built pages work in a browser and offline."""

import json
import re
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from urllib.parse import quote, urlsplit

import pytest
from chromium import started, wait

import kratos_lite as kl

ROOT = Path(__file__).resolve().parents[1]
SITE = ROOT / "build" / "site"
PAGES = (
    "index.html",
    "tutorials/01-b-and-k-by-hand.html",
    "howto/choose-an-element.html",
    "topics/weak-form.html",
    "reference/models.html",
    "reference/command-line.html",
    "gallery/index.html",
    "about/verification.html",
)


def test_every_public_name_is_in_the_reference():
    text = "\n".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs" / "reference").glob("*.md"))
    lists = re.findall(r"```\{public-names\}.*?\n(.*?)```", text, re.DOTALL)
    listed = {line.split()[0] for names in lists for line in names.splitlines() if line.strip()}
    missing = sorted(set(kl.__all__) - listed - {"__version__", "ale"})
    assert not missing, f"add {', '.join(missing)} to a page of docs/reference"
    assert set(kl.ale.__all__) <= listed


# ---- in a browser ------------------------------------------------------------------------------------


class Handler(SimpleHTTPRequestHandler):
    """Serves the site without a word."""

    def log_message(self, *words):
        pass


@pytest.fixture(scope="module")
def site():
    if not (SITE / "index.html").exists():
        pytest.skip("the site is not built: python -m sphinx -W docs build/site")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, directory=str(SITE)))
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()


@pytest.fixture(scope="module")
def browser(site, tmp_path_factory):
    with started(tmp_path_factory.mktemp("browser"), "1200,900") as driver:
        yield driver


def sound(browser):
    """Assert that nothing failed and nothing was asked of another host."""
    errors = [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert errors == []
    sent = [json.loads(entry["message"])["message"]["params"] for entry in browser.get_log("performance")]
    own = [
        part["request"]["url"]
        for part in sent
        if "127.0.0.1" in part.get("documentURL", "") and "request" in part
    ]
    assert {urlsplit(url).hostname for url in own if url.startswith("http")} == {"127.0.0.1"}


@pytest.mark.parametrize("page", PAGES)
def test_pages_load_without_errors_and_from_the_site_alone(browser, site, page):
    browser.get(site + page)
    wait(browser, "document.readyState === 'complete'")
    assert browser.find_element("tag name", "h1").text
    if browser.execute_script("return document.querySelector('.math') !== null"):
        wait(browser, "document.querySelector('mjx-container svg') !== null")
    broken = "filter(i => i.complete && !i.naturalWidth && i.loading != 'lazy').map(i => i.src)"
    assert browser.execute_script(f"return [...document.images].{broken}") == []
    sound(browser)


@pytest.mark.parametrize(
    ("words", "page"),
    [
        *(("hourglass", "tutorials/"), ("formulation", "choose-an-element")),
        *(("reaction_resultant", "results"), ("bolt+preload", "words"), ("RBE3", "supports-and-ties")),
    ],
)
def test_the_search_finds_pages(browser, site, words, page):
    browser.get(f"{site}search.html?q={words}")
    wait(browser, "document.querySelectorAll('#search-results li a').length > 0")
    wait(browser, "/found (\\d+|one) page/.test(document.querySelector('#search-results').innerText)")
    links = [
        link.get_attribute("href") for link in browser.find_elements("css selector", "#search-results li a")
    ]
    assert any(page in link for link in links), links
    sound(browser)


@pytest.mark.parametrize(
    ("words", "page", "said"),
    [
        ("B-bar", "topics/locking", "B-bar"),
        ("Newton-Raphson", "howto/nonlinear-steps", "Newton–Raphson"),
        ("Gaussian quadrature", "topics/quadrature", "Gaussian quadrature"),
        ("Voigt notation", "topics/symbols", "Voigt notation"),
        ("plane stress", "about/limits", "plane stress"),
        ("resultant", "howto/loads", "Resultant"),
        ("MPC", "howto/supports-and-ties", "(MPC)"),
    ],
)
def test_the_page_of_words_says_what_is_found_first(browser, site, words, page, said):
    browser.get(f"{site}search.html?q={quote(words)}")
    first = "document.querySelector('#search-results li')"
    text = wait(browser, f"{first}?.querySelector('p.context')?.innerText")
    assert browser.execute_script(f"return {first}.querySelector('a').href").endswith(f"/{page}.html")
    assert said in text
    assert "\\" not in text


def test_hits_have_their_text_without_a_server(browser, site):
    browser.get((SITE / "search.html").as_uri() + "?q=hourglass")
    wait(browser, "document.querySelector('#search-results p.context')?.innerText.includes('hourglass')")


def test_a_phone_shows_pages_in_its_width(browser, site):
    size = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    try:
        for page in (
            "index.html",
            "reference/models.html",
            "gallery/index.html",
            "about/verification/shells.html",
        ):
            browser.get(site + page)
            assert wait(browser, "document.documentElement.scrollWidth") <= 400, page
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
