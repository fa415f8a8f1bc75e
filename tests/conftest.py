"""Fixtures shared by all tests."""

from pathlib import Path

import pytest

collect_ignore = ["interop/kratos_driver.py"]
"""Scripts that tests run in other processes."""


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of real input files beside the repository; tests that need it skip without it."""
    folder = Path(__file__).resolve().parents[2] / "shared"
    if not (folder / "cases").is_dir():
        pytest.skip("the folder of real input files is not there")
    return folder
