"""UMAT: a law that is a subroutine UMAT of Abaqus in a compiled library."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kratos_lite import voigt
from kratos_lite.errors import MaterialError, SolveError
from kratos_lite.materials.material import GaussState, Material, Response
from kratos_lite.registry import remembered
from kratos_lite.validation import finite, number, path_of, whole_number

ORDER = voigt.ABAQUS
GUARD = np.full(100, np.nan)
"""What stands behind constants and state variables, which a subroutine must not use."""
ARGUMENTS = (
    "STRESS STATEV DDSDDE SSE SPD SCD RPL DDSDDT DRPLDE DRPLDT STRAN DSTRAN TIME DTIME TEMP DTEMP PREDEF "
    "DPRED CMNAME NDI NSHR NTENS NSTATV PROPS NPROPS COORDS DROT PNEWDT CELENT DFGRD0 DFGRD1 NOEL NPT LAYER "
    "KSPT KSTEP KINC"
).split()


@dataclass(frozen=True)
class UMAT(Material, family=True):
    """A law of small strains that is a subroutine UMAT, as Abaqus takes it, in a shared library.

    Parameters
    ----------
    path : the library, with the symbol ``umat_``, as gfortran names ``SUBROUTINE UMAT``.
    constants : PROPS.
    state_variables : length of STATEV, all 0 at the beginning.
    density : kg/m³.
    symmetric_tangent : whether DDSDDE is symmetric.

    Raises
    ------
    MaterialError
        There is no such library or symbol, or the subroutine uses more numbers than it is given.

    Notes
    -----
    A DDSDDE of 0 is found by differences.  PNEWDT below 1 cuts the step.  CELENT is the cube root of the
    volume of the element, KINC 1 at a point at rest, else 2, DFGRD and DROT the unit tensor; TIME,
    temperatures, fields and places are 0.  Source: Abaqus User Subroutines Reference Guide, UMAT.
    """

    path: str
    constants: Sequence[float]
    state_variables: int = 0
    density: float = 0.0
    symmetric_tangent: bool = True  # type: ignore[misc]

    def __post_init__(self) -> None:
        count = whole_number(self.state_variables, "state_variables", least=0, error=MaterialError)
        constants = finite(self.constants, "the constants of a UMAT", ("n",), error=MaterialError)
        number(self.density, "density", least=0.0, unit="kg/m³", error=MaterialError)
        sizes = {"last_strain": 6, "last_stress": 6, "element_length": 1, "state_variables": count}
        known: dict[str, Any] = {"constants": tuple(constants.tolist()), "path": str(path_of(self.path))}
        vars(self).update(known, internal_variables={name: n for name, n in sizes.items() if n})
        try:
            self.evaluate(np.zeros((1, 6)), self.initial_state(1), 1.0)
        except SolveError as error:
            raise MaterialError(f"{self.path}: {error}; it may need more constants") from None

    def response(self, strain: Any, state: GaussState, dt: float) -> Response:
        """Return what the subroutine gives, point by point; see `Material.response`."""
        n, count = strain[..., 0].size, self.state_variables
        before, stress = (state[name].reshape(n, 6).take(ORDER, 1) for name in ("last_strain", "last_stress"))
        inside = [state["state_variables"].reshape(n, count)] if count else []
        statev, D, part = np.hstack([*inside, np.tile(GUARD, (n, 1))]), np.zeros((n, 6, 6)), np.ones((n, 1))
        length = state["element_length"].reshape(n, 1)
        given = {"STRESS": stress, "STATEV": statev, "DDSDDE": D, "PNEWDT": part, "STRAN": before}
        given |= {"DSTRAN": strain.reshape(n, 6).take(ORDER, 1) - before, "DTIME": np.full((1, 1), dt)}
        given |= {"PROPS": np.append(self.constants, GUARD)[None], "CELENT": np.where(length > 0, length, 1)}
        given |= dict.fromkeys(("DROT", "DFGRD0", "DFGRD1"), np.eye(3)[None])
        given["KINC"] = np.where(before.any(axis=1), 2, 1).astype(np.int32)[:, None]
        whole = dict.fromkeys(("NOEL", "NPT", "LAYER", "KSPT", "KSTEP"), 1)
        whole |= {"NDI": 3, "NSHR": 3, "NTENS": 6, "NSTATV": count, "NPROPS": len(self.constants)}
        _call(self.path, n, given | {k: np.array([[v, 0, 0, 0]], np.int32) for k, v in whole.items()})
        if (part < 1).any():
            raise SolveError(f"{self.path} asks for a smaller step, PNEWDT = {part.min():g}")
        if not np.isnan(statev[:, count:]).all():
            raise MaterialError(f"{self.path} has more state variables than {count}; say how many it has")
        new = {
            "last_strain": strain,
            "last_stress": stress.take(ORDER, 1),
            "state_variables": statev[:, :count],
        }
        found = {name: np.reshape(new.get(name, old), old.shape).copy() for name, old in state.items()}
        tangent = D.swapaxes(1, 2)[:, ORDER][:, :, ORDER].reshape(*strain.shape, 6)
        return found["last_stress"].copy(), tangent if D.any() else None, found


def _call(path: str, n: int, given: dict[str, Any]) -> None:
    """Call a subroutine for n points with arrays (n or 1, …) by the names of its arguments."""
    blank = {"CMNAME": np.full((1, 80), b" ")}
    arrays = [(blank | given).get(name, np.zeros((1, 6))) for name in ARGUMENTS]
    first = np.array([array.ctypes.data for array in arrays])
    step = np.array([array.strides[0] if len(array) == n else 0 for array in arrays])
    routine = _routine(path)
    for i in range(n):
        routine(*(first + i * step).tolist(), 80)  # the length of CMNAME, as Fortran has it


@remembered
def _routine(path: str) -> Any:
    """Return the subroutine of a library."""
    how = "compile it with gfortran -shared -fPIC -O2 umat.f -o umat.so"
    try:
        routine = ctypes.CDLL(path).umat_
    except OSError as error:
        raise MaterialError(f"the library of a UMAT cannot be loaded: {error}; {how}") from None
    except AttributeError:
        raise MaterialError(f"{path} has no symbol umat_, that of SUBROUTINE UMAT; {how}") from None
    routine.argtypes, routine.restype = [ctypes.c_void_p] * len(ARGUMENTS) + [ctypes.c_size_t], None
    return routine
