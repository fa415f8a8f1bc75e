"""A folder with the files that run files of the tests name."""

import json

import pytest
from run_files import MATERIALS, box_mdpa


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "box.mdpa").write_text(box_mdpa())
    (tmp_path / "materials.json").write_text(json.dumps(MATERIALS))
    return tmp_path
