"""Build what is distributed and try it: ``python -m tests.packages``, where the library's dependencies are.

The source distribution, from it a wheel without kernels and one with them, each tried as installed; then the
latter with the oldest versions that ``pyproject.toml`` allows, where this Python has them.
"""

import os
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[2]
QUICK = ROOT / "tests" / "packages" / "quick.py"
OLDEST = ROOT / ".ci" / "oldest.txt"
NEWEST_WITH_OLDEST = (3, 12)
"""The newest Python for which the oldest versions are built."""
INSTALL = ("install", "--quiet", "--disable-pip-version-check", "--no-compile")
"""Each module is compiled when it is first imported: most never are."""
MOST = 3 * 2**20
"""Bytes of a wheel."""


def run(*command: object, **environment: str) -> None:
    """Run a command that must succeed, away from the source tree; what it prints is shown if it fails."""
    done = subprocess.run(
        [str(word) for word in command],
        cwd=tempfile.gettempdir(),
        env={**os.environ, "PYTHONPATH": "", **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout[-8000:]}")


def environment(folder: Path, *packages: object) -> Path:
    """Return the interpreter of a new environment with some packages."""
    run(sys.executable, "-m", "venv", "--without-pip", folder)
    python = folder / ("Scripts" if os.name == "nt" else "bin") / "python"
    run(sys.executable, "-m", "pip", "--python", python, *INSTALL, *packages)
    return python


def source_distribution(python: Path, folder: Path) -> Path:
    """Return the folder of the unpacked source distribution."""
    run(python, "-m", "build", "--sdist", "--no-isolation", "--outdir", folder, ROOT)
    (archive,) = folder.glob("*.tar.gz")
    with tarfile.open(archive) as packed:
        if hasattr(tarfile, "data_filter"):
            packed.extraction_filter = tarfile.data_filter
        packed.extractall(folder)
    return archive.with_suffix("").with_suffix("")


def wheel(python: Path, source: Path, kind: str) -> Path:
    """Return the wheel of a kind, checked for what is in it."""
    folder = source.parent / kind
    command = ("-m", "build", "--wheel", "--no-isolation", "--outdir", folder, source)
    run(python, *command, KRATOS_LITE_BUILD=kind)
    (made,) = folder.glob("*.whl")
    with zipfile.ZipFile(made) as packed:
        names = packed.namelist()
    kernels = [name for name in names if name.endswith((".so", ".pyd"))]
    expected = 0 if kind == "pure" else len(list((ROOT / "kratos_lite" / "native").glob("*.cpp")))
    assert len(kernels) == expected, kernels
    assert ("py3-none-any" in made.name) == (kind == "pure"), made.name
    sources = (".cpp", ".hpp")
    strange = [name for name in names if not name.startswith("kratos_lite") or name.endswith(sources)]
    assert not strange, strange
    assert made.stat().st_size < MOST, made.stat().st_size
    return made


def try_wheel(made: Path, computes: str) -> None:
    """Try a wheel with the dependencies of this environment."""
    site = made.parent / "site"
    run(sys.executable, "-m", "pip", *INSTALL, "--no-deps", "--target", site, made)
    run(sys.executable, QUICK, computes, site, PYTHONPATH=str(site))


def try_oldest(folder: Path, made: Path) -> None:
    """Try a wheel with the oldest versions."""
    python = environment(folder, "--only-binary", ":all:", "-c", OLDEST, f"{made}[view]")
    run(python, QUICK, "compiled")


def timed(what: str, step: Callable[..., object], *arguments: object) -> object:
    """Return what a step returns, and say how long it took."""
    start = time.monotonic()
    found = step(*arguments)
    made = isinstance(found, Path) and found.suffix == ".whl"
    size = f", {found.stat().st_size / 2**20:.2f} MiB" if made else ""
    sys.stdout.write(f"{what}: {time.monotonic() - start:.0f} s{size}\n")
    sys.stdout.flush()
    return found


def main() -> None:
    """Build and try everything."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        python = timed("environment", environment, folder / "build", "build", "setuptools>=77")
        source = timed("source distribution", source_distribution, python, folder)
        pure = timed("pure wheel", wheel, python, source, "pure")
        timed("pure wheel, tried", try_wheel, pure, "NumPy")
        compiled = timed("wheel with kernels", wheel, python, source, "compiled")
        timed("wheel with kernels, tried", try_wheel, compiled, "compiled")
        if sys.version_info[:2] <= NEWEST_WITH_OLDEST:
            timed("oldest versions, tried", try_oldest, folder / "oldest", compiled)


if __name__ == "__main__":
    main()
