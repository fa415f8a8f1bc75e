"""meshio, which reads files of other programs: in a process of its own, with limits of memory and time.

meshio believes the counts that a file states, so a damaged file may take all memory or never end; a limit
ends that process alone.  The process serves all files that a program reads, and ends with the program.
"""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from kratos_lite.errors import InputError
from kratos_lite.records import field, record
from kratos_lite.validation import free_memory

SECONDS = 30.0
"""Computing time that every file may take; a large one more, by `BYTES_PER_SECOND`."""
BYTES_PER_SECOND = 1e5
MEMORY = 1.5e9
"""Bytes that every file may take; a large one more, `GROWTH` times its size."""
GROWTH = 100.0
WAIT = 20.0
"""Times the computing time after which a process is ended that computes nothing."""
OURS = {".mdpa", ".svg", ".ele", ".node", ".xml"}
"""Endings left to others: read by ourselves, pictures, or spread over several files."""

Numbers = NDArray[Any]


@record
class Cells:
    """Cells of one type of meshio: rows (m, k) of the points; (m, 0) where their number of nodes differs."""

    type: str
    dim: int
    data: Numbers


@record
class Found:
    """What meshio finds in a file; data that are no numbers are None.  `output` is what meshio says."""

    points: Numbers
    cells: list[Cells]
    point_data: dict[str, Any] = field(default_factory=dict)
    cell_data: dict[str, Any] = field(default_factory=dict)
    field_data: dict[str, Any] = field(default_factory=dict)
    point_sets: dict[str, Any] = field(default_factory=dict)
    cell_sets: dict[str, Any] = field(default_factory=dict)
    output: str = ""


FIELDS = ("point_data", "cell_data", "field_data", "point_sets", "cell_sets")


def read_foreign(path: Path) -> Found:
    """Return what meshio finds in a file; InputError if it cannot be read within the limits."""
    size = path.stat().st_size if path.is_file() else 0
    seconds = SECONDS + size / BYTES_PER_SECOND
    memory = min(MEMORY + GROWTH * size, free_memory())
    if not sys.executable:  # Python inside another program: nothing can be started
        answer, arrays = load(path)
    else:
        answer, arrays = _process.ask(path, seconds, memory)
    if "error" in answer:
        raise InputError(f"{path}{answer['error']}")
    sets = {name: _unpacked(answer[name], arrays) for name in FIELDS}
    cells = [Cells(kind, dim, _unpacked(at, arrays)) for kind, dim, at in answer["cells"]]
    counts = [len(one.data) for one in cells]
    for name, values in sets["cell_data"].items():
        if not isinstance(values, list) or [-1 if v is None else len(v) for v in values] != counts:
            sets["cell_data"][name] = []  # no numbers: its name is all that is of use
    return Found(_unpacked(answer["points"], arrays), cells, **sets, output=answer["output"])


# ---- the process of this program -----------------------------------------------------------------------


class _Process:
    """The process that reads: started when it is first needed, and again after one that broke a limit."""

    def __init__(self) -> None:
        self.child: subprocess.Popen[bytes] | None = None
        self.owner = 0
        self.lock = threading.Lock()

    def ask(self, path: Path, seconds: float, memory: float) -> tuple[dict[str, Any], list[Numbers]]:
        """Return the answer for a file, and its arrays."""
        with self.lock:
            child = self._running()
            assert child.stdin is not None
            assert child.stdout is not None
            request = {"path": os.path.abspath(path), "seconds": seconds, "memory": memory}
            watch = threading.Timer(WAIT * seconds, child.kill)
            watch.start()
            try:
                child.stdin.write(json.dumps(request).encode() + b"\n")
                child.stdin.flush()
                return _received(child.stdout)
            except (BrokenPipeError, EOFError):
                raise InputError(f"{path}: {self._why(child, seconds)}") from None
            except BaseException:
                self.end()  # Ctrl-C: an answer that nobody reads would meet the next question
                raise
            finally:
                watch.cancel()

    def _running(self) -> subprocess.Popen[bytes]:
        """Return the process; after a fork of this program it belongs to the other one."""
        if self.child is None or self.owner != os.getpid() or self.child.poll() is not None:
            import atexit

            code = (
                "import json, sys\nsys.path[:] = json.loads(sys.argv[1])\n"
                "from kratos_lite.io.formats.foreign import serve\nserve()"
            )
            self.child = subprocess.Popen(
                [sys.executable, "-c", code, json.dumps(sys.path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            )
            self.owner = os.getpid()
            atexit.register(self.end)
        return self.child

    def _why(self, child: subprocess.Popen[bytes], seconds: float) -> str:
        """Return why a process has ended."""
        with suppress(subprocess.TimeoutExpired):
            child.wait(1.0)  # else it ends by our signal, and its own reason is lost
        self.end()
        cure = "are its counts right, and is it complete? Save it anew, as .msh of version 4.1 or .vtu"
        if child.returncode in (-getattr(signal, "SIGXCPU", 24), -getattr(signal, "SIGKILL", 9)):
            return f"meshio does not end within {seconds:.3g} s; {cure}"
        return f"meshio fails on it (code {child.returncode}); {cure}"

    def end(self) -> None:
        """End the process."""
        child, self.child = self.child, None
        if child is not None and self.owner == os.getpid():
            for stream in (child.stdin, child.stdout):
                with suppress(OSError, AttributeError):
                    stream.close()  # type: ignore[union-attr]
            child.kill()
            child.wait()


_process = _Process()


def _received(stream: IO[bytes]) -> tuple[dict[str, Any], list[Numbers]]:
    """Return an answer and its arrays; EOFError if the process ends before."""
    answer = json.loads(_bytes_of(stream, int.from_bytes(_bytes_of(stream, 8), "little")))
    arrays = []
    for kind, shape in answer.pop("arrays"):
        count = int(np.prod(shape, dtype=np.int64))
        data = _bytes_of(stream, count * np.dtype(kind).itemsize)
        arrays.append(np.frombuffer(data, dtype=kind).reshape(shape))
    return answer, arrays


def _bytes_of(stream: IO[bytes], count: int) -> bytearray:
    data = bytearray(count)
    if stream.readinto(data) != count:  # type: ignore[attr-defined]
        raise EOFError
    return data


def _unpacked(value: Any, arrays: list[Numbers]) -> Any:
    """Return a value in which arrays stand for their numbers."""
    if isinstance(value, dict):
        return {name: _unpacked(one, arrays) for name, one in value.items()}
    if isinstance(value, list):
        return [_unpacked(one, arrays) for one in value]
    return value if value is None else arrays[value]


# ---- the other process ---------------------------------------------------------------------------------


def serve() -> None:
    """Answer questions until there are no more."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what meshio prints must not become an answer
    for line in sys.stdin:
        request = json.loads(line)
        _limit(request["seconds"], request["memory"])
        answer, arrays = load(Path(request["path"]))
        if "error" in answer:
            answer["error"] = answer["error"].replace(request["path"], Path(request["path"]).name)
        head = json.dumps({**answer, "arrays": [(a.dtype.str, a.shape) for a in arrays]}).encode()
        answers.write(len(head).to_bytes(8, "little") + head)
        for array in arrays:
            answers.write(np.ascontiguousarray(array).data.cast("B") if array.size else b"")
        answers.flush()


def _limit(seconds: float, memory: float) -> None:
    """Let this process take so much more computing time and memory than it has taken."""
    with suppress(ImportError, ValueError, OSError):  # other systems than Unix know the time alone
        import resource

        used = resource.getrusage(resource.RUSAGE_SELF)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        for kind, most in (
            (resource.RLIMIT_CPU, used.ru_utime + used.ru_stime + seconds + 1),
            (resource.RLIMIT_AS, pages * resource.getpagesize() + memory),
            (resource.RLIMIT_CORE, 0),
        ):
            hard = resource.getrlimit(kind)[1]
            end = int(most) if hard == resource.RLIM_INFINITY else min(int(most), hard)
            resource.setrlimit(kind, (end, hard))


def load(path: Path) -> tuple[dict[str, Any], list[Numbers]]:
    """Read a file with meshio; return what is found with numbers of arrays, and the arrays."""
    arrays: list[Numbers] = []
    try:
        check_ending(path)
        with guarded(path, "read") as (meshio, output):
            found = meshio.read(path)
            cells = [(one.type, int(one.dim), _packed(_rows(one.data), arrays)) for one in found.cells]
            answer = {name: _packed(getattr(found, name), arrays) for name in FIELDS}
            answer |= {"points": _packed(np.asarray(found.points), arrays), "cells": cells}
    except InputError as error:
        return {"error": str(error).removeprefix(str(path))}, []
    except ImportError as error:
        return {"error": f": {error}; this format needs it: pip install {error.name}"}, []
    except MemoryError:
        text = "is it complete, and are its counts right? Else convert it on a machine with more memory"
        return {"error": f": meshio needs more memory than there is; {text}"}, []
    return {**answer, "output": output.getvalue()}, arrays


def _rows(data: Any) -> Numbers:
    """Return the nodes of cells; only their number where they are no table of whole numbers."""
    try:
        rows = np.asarray(data)
    except ValueError:
        rows = np.zeros(0)
    return rows if rows.dtype.kind in "iu" and rows.ndim == 2 else np.zeros((len(data), 0), dtype=np.int64)


def _packed(value: Any, arrays: list[Numbers]) -> Any:
    """Return a value in which the numbers of arrays stand for them; None for what is no numbers."""
    if isinstance(value, dict):
        return {str(name): _packed(one, arrays) for name, one in value.items()}
    if isinstance(value, list) and any(one is None or isinstance(one, np.ndarray) for one in value):
        return [_packed(one, arrays) for one in value]
    try:
        array = np.asarray(value)
    except ValueError:
        return None
    if value is None or array.dtype.kind not in "biuf":
        return None
    arrays.append(array.astype(array.dtype.newbyteorder("<"), copy=False))
    return len(arrays) - 1


# ---- meshio --------------------------------------------------------------------------------------------


def check_ending(path: Path, own: str = ".mdpa .elem") -> None:
    """Refuse an ending that meshio does not know, in words rather than by leaving the program."""
    import meshio

    endings = sorted(set(meshio.extension_to_filetypes) - OURS)
    if not path.name.lower().endswith(tuple(endings)):
        raise InputError(f"{path}: unknown ending {path.suffix!r}; known are {own} {' '.join(endings)}")


@contextmanager
def guarded(path: Path, done: str) -> Iterator[tuple[Any, io.StringIO]]:
    """Give meshio and what it says; meshio prints and ends the program where others raise."""
    import meshio
    from meshio import _mesh

    for missing in ("wedge15", "pyramid13"):  # meshio 5.3.5 knows both but fails on their dimension
        _mesh.topological_dimension.setdefault(missing, 3)
    output, listing = io.StringIO(), io.StringIO()
    try:
        with redirect_stderr(output), redirect_stdout(listing), np.errstate(all="ignore"):
            yield meshio, output
    except ImportError as error:
        raise InputError(f"{path}: {error}; this format needs it: pip install {error.name}") from error
    except (InputError, MemoryError):
        raise
    except OSError as error:
        if done == "written":
            raise  # the disk, not the format
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (Exception, SystemExit) as error:
        last = "" if isinstance(error, SystemExit) else repr(error)
        reason = " ".join(f"{output.getvalue()} {listing.getvalue()} {last}".split())
        cure = "is the file complete?" if done == "read" else ".vtu and .vtk hold every mesh"
        raise InputError(f"{path}: cannot be {done} by meshio: {reason[:400]}; {cure}") from error
