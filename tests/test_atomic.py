import errno
import os
import stat
from pathlib import Path

import pytest

from kratos_lite.atomic import all_or_none, replacing, write_whole
from kratos_lite.errors import InputError

FULL = OSError(errno.ENOSPC, "No space left on device")


def _full(*_):
    raise FULL


@pytest.fixture
def old(tmp_path):
    file = tmp_path / "result.vtu"
    file.write_bytes(b"old")
    return file


def half_written(path, error=None):
    """Write half of a file, and raise an error if there is one."""
    with replacing(path) as temporary:
        temporary.write_bytes(b"half")
        if error:
            raise error


@pytest.mark.parametrize("place", ["fsync", "replace", "within"])
def test_a_failing_disk_leaves_the_old_file(old, monkeypatch, place):
    if place != "within":
        monkeypatch.setattr(os, place, _full)
    with pytest.raises(InputError, match=r"result\.vtu: .*No space left.*; free some space$") as error:
        half_written(old, FULL if place == "within" else None)
    assert error.value.__cause__ is FULL
    assert old.read_bytes() == b"old"
    assert list(old.parent.iterdir()) == [old]


@pytest.mark.parametrize("kind", [KeyboardInterrupt, ZeroDivisionError])
def test_any_interruption_passes_through_and_leaves_the_old_file(old, kind):
    with pytest.raises(kind):
        half_written(old, kind())
    assert old.read_bytes() == b"old"
    assert list(old.parent.iterdir()) == [old]


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(InputError, match=r"there is no folder .*nowhere; create it"):
        write_whole(tmp_path / "nowhere" / "a.txt", b"")


@pytest.mark.parametrize("path", ["folder", "/dev/full"])
def test_folders_and_devices_are_refused(tmp_path, path):
    (tmp_path / "folder").mkdir()
    target = tmp_path / path
    if not target.exists():
        pytest.skip(f"no {path} on this system")
    kind = stat.S_IFMT(target.stat().st_mode)
    with pytest.raises(InputError, match="a folder or a device, not a file"):
        write_whole(target, b"x")
    assert stat.S_IFMT(target.stat().st_mode) == kind


def test_a_link_stays_a_link_and_permissions_are_kept(tmp_path):
    real, link = tmp_path / "real.txt", tmp_path / "link.txt"
    real.write_bytes(b"old")
    real.chmod(0o640)
    link.symlink_to(real)
    write_whole(link, b"new")
    assert link.is_symlink()
    assert real.read_bytes() == b"new"
    assert stat.S_IMODE(real.stat().st_mode) == 0o640


def test_a_new_file_gets_the_permissions_of_the_user(tmp_path):
    write_whole(tmp_path / "a", b"")
    (tmp_path / "b").touch()
    assert (tmp_path / "a").stat().st_mode == (tmp_path / "b").stat().st_mode


def test_a_relative_name_without_folder_is_written_here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_whole("a.txt", b"here")
    assert Path("a.txt").read_bytes() == b"here"


def test_a_file_keeps_its_ending_until_it_replaces_the_old_one(old):
    with replacing(old) as temporary:
        assert (temporary.suffix, temporary.parent) == (".vtu", old.parent)
        temporary.write_bytes(b"new")
        assert old.read_bytes() == b"old"
    assert old.read_bytes() == b"new"


def test_files_of_one_run_take_their_places_together_or_not_at_all(old):
    new = old.with_name("result.json")
    with all_or_none():
        with all_or_none():
            write_whole(new, b"new")
        write_whole(old, b"one")
        assert not new.exists()
        assert old.read_bytes() == b"old"
    assert (new.read_bytes(), old.read_bytes()) == (b"new", b"one")

    def both():
        with all_or_none():
            write_whole(new, b"later")
            half_written(old, FULL)

    with pytest.raises(InputError, match="free some space"):
        both()
    assert (new.read_bytes(), old.read_bytes()) == (b"new", b"one")
    assert sorted(old.parent.iterdir()) == [new, old]
