"""Build single kernels with other flags, or of other sources, into a folder of their own."""

import re
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

FLAGS = ["-std=c++17", "-fPIC", "-shared", "-fvisibility=hidden", "-fwrapv", "-pthread", "-fno-math-errno"]


def users_of(source: Path) -> list[Path]:
    """Return the ``.cpp`` files of a folder that are or include a source, also by way of other headers."""
    included, before = {source.name}, 0
    files = [*source.parent.glob("*.hpp"), *source.parent.glob("*.cpp")]
    while len(included) > before:
        before = len(included)
        for file in files:
            if included & set(re.findall(r'#include "(.*)"', file.read_text())):
                included.add(file.name)
    return sorted(file for file in files if file.suffix == ".cpp" and file.name in included)


def build(sources: list[Path], folder: Path, *flags: str) -> None:
    """Compile kernels, two at a time, into a folder."""
    include = f"-I{sysconfig.get_paths()['include']}"

    def compile_one(source: Path) -> None:
        out = folder / f"_{source.stem}{sysconfig.get_config_var('EXT_SUFFIX')}"
        command = ["g++", *FLAGS, *flags, include, str(source), "-o", str(out)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{' '.join(command)}\n{done.stderr}")

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(compile_one, sources))
