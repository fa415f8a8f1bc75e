"""Build the compiled kernels: every `kratos_lite/native/*.cpp` is one extension module.

A machine without a compiler installs the package all the same and computes with NumPy and SciPy.

Environment
-----------
KRATOS_LITE_BUILD : ``compiled`` makes a kernel that cannot be built an error, ``pure`` builds none: the wheel
    then serves every platform. Else kernels are built where that is possible, and for the instruction set of
    this machine alone where the source tree itself is installed (``-e``), in two thirds of the time.
"""

import os
import shutil
import subprocess
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

NATIVE = Path("kratos_lite/native")
LONGEST = ("multigrid", "gauss", "stiffness")
"""What takes longest to compile comes first, so that no processor waits for it at the end."""
# -fwrapv keeps operands of multiply-adds in registers: stiffness takes a fifth less time.
# -g0 because Python's own flags may ask for debug symbols, which double the time to compile.
GCC = ["-std=c++17", "-O3", "-g0", "-fwrapv", "-pthread", "-fno-math-errno", "-fvisibility=hidden"]
CLANG_CL = ["/std:c++17", "/EHsc", "/DNOMINMAX", "/clang:-O3", "/clang:-fwrapv", "/clang:-fno-math-errno"]
WISH, WISHES = os.environ.get("KRATOS_LITE_BUILD", ""), ("", "compiled", "pure")


class Build(build_ext):
    """Compile as many modules at a time as there are processors, on Windows with clang-cl."""

    def finalize_options(self) -> None:
        """Let the processors that this process may use compile."""
        super().finalize_options()
        affinity = getattr(os, "sched_getaffinity", None)
        self.parallel = self.parallel or (len(affinity(0)) if affinity else os.cpu_count() or 1)

    def build_extensions(self) -> None:
        """Add the flags of the compiler; kernels are written with vectors that MSVC's own does not know."""
        windows = self.compiler.compiler_type == "msvc"
        if windows:
            self.compiler.initialize()
            self.compiler.cc = shutil.which("clang-cl") or self.compiler.cc
        here = self._instruction_set() if self.editable_mode and not WISH else []
        for extension in self.extensions:
            extension.extra_compile_args = CLANG_CL if windows else [*GCC, "-Wall", "-Wextra", *here]
            extension.extra_link_args = [] if windows else ["-pthread"]
        super().build_extensions()

    def _instruction_set(self) -> list[str]:
        """Return the macro for the instruction set of this machine; none where the compiler cannot tell."""
        ask = [self.compiler.compiler_so[0], "-march=native", "-dM", "-E", "-x", "c", os.devnull]
        try:
            macros = subprocess.run(ask, capture_output=True, text=True, check=True).stdout
        except (AttributeError, OSError, subprocess.CalledProcessError):
            return []
        wide = all(f"__AVX512{part}__" in macros for part in ("F", "DQ", "BW", "VL"))
        return [f"-DKL_ISA={2 if wide else 1 if '__AVX2__' in macros and '__FMA__' in macros else 0}"]


def kernels(wish: str) -> list[Extension]:
    """Return the modules to build, what takes longest first."""
    if wish not in WISHES:
        raise SystemExit(f"KRATOS_LITE_BUILD={wish!r}; expected compiled or pure, or nothing")
    headers = [header.as_posix() for header in NATIVE.glob("*.hpp")]
    sources = sorted(NATIVE.glob("*.cpp"), key=lambda source: (source.stem not in LONGEST, source.stem))
    return [
        Extension(
            f"kratos_lite.native._{source.stem}",
            [source.as_posix()],
            depends=headers,
            language="c++",
            optional=not wish,
        )
        for source in sources
        if wish != "pure"
    ]


setup(cmdclass={"build_ext": Build}, ext_modules=kernels(WISH))
