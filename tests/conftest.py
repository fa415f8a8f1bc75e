"""Fixtures shared by all tests."""

import gc
import os
import shutil
import signal
import tempfile
from pathlib import Path

if "PYTEST_XDIST_WORKER" in os.environ:  # workers share the processors: dense algebra of two would compete
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from commands import run  # noqa: F401
from malformed import write_malformed
from scenes import SHARED

from kratos_lite.view import canvas

collect_ignore = ["interop/kratos_driver.py", "interop/kratos_parts_driver.py", "fixtures/bad"]
"""Scripts that tests run, and those that must fail."""


signal.signal(
    signal.SIGINT, signal.default_int_handler
)  # a shell in the background ignores it, and so would children

canvas.DPI = 40  # pictures of tests are small

SOURCES = ["fixtures", "shared"] if (SHARED / "cases").is_dir() else ["fixtures"]


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of real input files beside the repository."""
    return SHARED


LONGEST = (
    *("test_table.py", "test_over_ranks.py", "test_command.py"),
    *("test_examples.py", "test_benchmarks.py"),
)
"""Files whose tests come first: no worker begins one when the others are done, or shares its fixtures."""


MEMORY = Path("/dev/shm")
"""Where files lie in memory: tests write thousands, and a disk takes 3 ms for each that is there already."""


def pytest_configure():
    """Collect no garbage while tests are collected; let processes that tests start keep what they compile."""
    gc.disable()
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    if "TMPDIR" in os.environ or not os.access(MEMORY, os.W_OK) or shutil.disk_usage(MEMORY).free < 2**31:
        return
    if not os.statvfs(MEMORY).f_flag & os.ST_NOEXEC:  # some tests compile what they load
        os.environ["TMPDIR"] = tempfile.tempdir = str(MEMORY)


def pytest_collection_modifyitems(items):
    """Put the longest tests first; leave out those of real files where these are absent.

    Others show the same with `fixtures`.
    """
    items.sort(key=lambda item: item.path.name not in LONGEST)
    if "shared" not in SOURCES:
        items[:] = [item for item in items if "shared" not in getattr(item, "fixturenames", ())]


def pytest_collection_finish():
    gc.freeze()  # the tests themselves are no garbage
    gc.enable()


@pytest.fixture(scope="session", params=SOURCES)
def malformed(request, tmp_path_factory) -> Path:
    """Folder of malformed input files, and others made from the outside by the same faults."""
    if request.param == "shared":
        return SHARED / "bad"
    folder = tmp_path_factory.mktemp("malformed")
    write_malformed(folder)
    return folder
