"""Model: a structure that can be solved."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from kratos_lite.analysis.prepared import check_own
from kratos_lite.analysis.result import Result
from kratos_lite.analysis.solution_checks import check_arguments
from kratos_lite.analysis.static import StaticAnalysis
from kratos_lite.errors import InputError
from kratos_lite.model.loads import Load
from kratos_lite.model.structure import Structure
from kratos_lite.typing import Array, ArrayLike, Complexes, Progress
from kratos_lite.view.progress import watched

if TYPE_CHECKING:
    from pathlib import Path

    from kratos_lite.analysis.harmonic import HarmonicLoads, HarmonicResponse
    from kratos_lite.analysis.matrices import LocalSystem, Matrices
    from kratos_lite.analysis.preload import Preload
    from kratos_lite.analysis.quantities_of_interest import Quantity
    from kratos_lite.analysis.quasi_static import QuasiStaticAnalysis
    from kratos_lite.analysis.transient import TransientAnalysis


class Model(Structure):
    """A body under load, and its analyses.

    Parameters
    ----------
    mesh : points, elements and named parts.
    material : one material for all elements, or materials by part name or property id.
    formulation : of the elements, in place of what their names in the mesh say: ``standard``, ``enhanced``,
        ``b_bar``, ``reduced``, ``total_lagrangian`` for large displacements, ``f_bar`` where ν → ½ then, or
        ``non_locking``: that of each shape which does not lock with its material.
    units : consistent set of units that mesh, material and all that is added are in, such as
        ``"mm N MPa t"``, as a label: no number changes; see `Mesh.use_units`.  That of the mesh if not given;
        ``"auto"`` recognizes it from E and density of the material.

    Raises
    ------
    InputError
        `mesh` is no Mesh, `material` no material, or an element of the mesh has no such formulation.
    MeshError
        A part or property of `material` does not exist.

    Examples
    --------
    >>> import kratos_lite as kl
    >>> model = kl.Model(kl.box(cells=(2, 2, 2)), kl.Isotropic3D(E=210e6, nu=0.3, density=7620.0))
    >>> for side, axis in (("x-", "x"), ("x+", "x"), ("y-", "y"), ("y+", "y"), ("z-", "z")):
    ...     model.fix(side, axis)
    >>> model.add(kl.Gravity((0.0, 0.0, -9.81)))
    >>> result = model.solve()
    >>> print(f"{result.displacement('z+')[:, 2].mean():.7e} m")
    -1.3221478e-04 m
    """

    def solve(
        self,
        solver: str = "auto",
        tolerance: float = 1e-10,
        progress: Progress | None = None,
        *,
        error: float | str | None = None,
        most_unknowns: int | None = None,
        geometry: Mapping[str, Callable[[Array], Array]] | None = None,
        quantity: Quantity | None = None,
        backend: str | None = None,
        petsc: str | None = None,
    ) -> Result:
        """Check the model and solve it: statics, or the steady state of a motion at the time 0.

        Laws that are not linear and large displacements are found by one step of `quasi_static`, which ends
        at the loads and supports of the time 1 s.

        Parameters
        ----------
        solver : ``auto``, ``dense``, ``direct`` or ``amg``, of linear models.
        tolerance : relative residual at which the iterative solver stops.
        progress : called with the phase and the fraction done, 0 … 1.
        error : relative error of the energy norm, such as 0.01 or ``"1%"``, for which the mesh is made finer
            and linear elements quadratic where needed; the result is on the final mesh, the model stays.
        most_unknowns : with `error`: no mesh with more of them is solved (as many as fit into the free
            memory); a warning says what was reached, and what it would take.
        geometry : with `error`: by part, a function that takes places (k, 3) in m near its true surface onto
            it; without, edges that are straight stay straight.
        quantity : with `error`: the error is that of a quantity, such as ``kl.DisplacementAt(point, "z")``,
            as `Result.error` estimates it, in place of the energy norm.  Relative to its value, which must
            not be 0.
        backend : ``own``, or ``petsc`` for statics by PETSc, which must be installed; if not given, that
            of one process.
        petsc : options of PETSc, which win over what is chosen: ``"-ksp_type cg -pc_type hypre"``.

        Returns
        -------
        Result
            Displacements, reactions, stresses and a report.

        Raises
        ------
        MeshError, ModelError, InputError
            If the model is broken, or its supports leave rigid-body modes free along which loads do not
            balance; what belongs to `error` is wrong or given without it; or the quantity is 0.
        SolveError
            If the accuracy requested cannot be reached.
        """
        unused = {"most_unknowns": most_unknowns, "geometry": geometry, "quantity": quantity}
        for name, value in unused.items():
            if value is not None and error is None:
                raise InputError(f"{name} belongs to a requested error; give error, such as error=0.01, too")
        with watched(progress) as shown:
            if error is not None:
                from kratos_lite.analysis.adaptive import solve_to  # a quick start without it

                check_own(backend, petsc, "a requested error")
                return solve_to(self, error, solver, tolerance, shown, most_unknowns, geometry, quantity)
            if self.motion is not None:
                from kratos_lite.analysis.steady import solve_steady  # a quick start for statics

                check_own(backend, petsc, "a motion of the material")
                return solve_steady(self, solver, tolerance, shown)
            if self.is_nonlinear:
                from kratos_lite.analysis.quasi_static import solve_nonlinear  # as above

                if backend == "petsc" or petsc is not None:
                    self.require_linear("backend='petsc'")
                check_arguments(solver, tolerance)
                return solve_nonlinear(self, solver, tolerance, shown)
            analysis = StaticAnalysis(self, solver, tolerance, shown, backend=backend, petsc=petsc)
            try:
                return analysis.solve()
            finally:
                analysis.release()  # the result keeps the analysis, which would keep the matrix

    def static(
        self,
        solver: str = "auto",
        tolerance: float = 1e-10,
        progress: Progress | None = None,
        *,
        backend: str | None = None,
        petsc: str | None = None,
    ) -> StaticAnalysis:
        """Check the model and return its static analysis, ready for many sets of loads.

        Matrix, factors or multigrid are made once.

        Parameters
        ----------
        solver, tolerance, progress, backend, petsc : as for `solve`.  The analysis's
            ``release()`` releases what PETSc holds.

        Returns
        -------
        StaticAnalysis
            Its ``solve(loads)`` is `solve` with these loads in place of those of the model.

        Raises
        ------
        MeshError, ModelError, InputError
            If the model is broken, or it has a motion.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.0, density=1000.0))
        >>> model.fix("z-")
        >>> analysis = model.static()
        >>> pull, push = (analysis.solve([kl.Traction("z+", (0, 0, t))]) for t in (1e6, -2e6))
        >>> print(f"{pull.u[:, 2].max():.1e} m, {push.u[:, 2].min():.1e} m")
        1.0e-03 m, -2.0e-03 m
        """
        return StaticAnalysis(self, solver, tolerance, progress, backend=backend, petsc=petsc)

    def solve_cases(
        self,
        cases: Mapping[str, Load | Sequence[Load]],
        solver: str = "auto",
        tolerance: float = 1e-10,
        progress: Progress | None = None,
        *,
        backend: str | None = None,
        petsc: str | None = None,
    ) -> dict[str, Result]:
        """Solve the model for several load cases, with one matrix.

        Parameters
        ----------
        cases : names and loads; each case has these loads, not those of the model.
        solver, tolerance, progress, backend, petsc : as for `solve`.

        Returns
        -------
        dict of Result
            By the names of the cases.

        Raises
        ------
        MeshError, ModelError, InputError, SolveError
            As for `solve`.
        """
        with watched(progress) as shown:
            analysis = StaticAnalysis(self, solver, tolerance, shown, backend=backend, petsc=petsc)
            try:
                return analysis.solve_cases(cases)
            finally:
                analysis.release()

    def check(self) -> list[str]:
        """Check the model with its loads as a solution does, without solving.

        Returns
        -------
        Warnings of the model, one sentence each.

        Raises
        ------
        MeshError, ModelError, InputError
            With every element or part that is wrong.
        """
        if self.motion is not None:
            from kratos_lite.analysis.equations_of_motion import EquationsOfMotion  # as above

            equations = EquationsOfMotion(self, free=False, steady=True)
            equations.load(0.0)
            return equations.warnings
        if self.is_nonlinear:
            steps = self.quasi_static()
            steps.applied(0.0)
            return steps.warnings
        analysis = StaticAnalysis(self)
        analysis.check()
        return analysis.warnings

    def transient(self, **options: Any) -> TransientAnalysis:
        """Return the transient analysis of the model.

        Parameters
        ----------
        options : those of `TransientAnalysis`, with the same errors.

        Returns
        -------
        TransientAnalysis

        Examples
        --------
        >>> import kratos_lite as kl
        >>> bar = kl.Model(kl.box((1, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0, density=1000.0))
        >>> bar.fix("z-")
        >>> bar.add(kl.Gravity((0, 0, -9.81)))
        >>> states = list(kl.integrate(bar.transient(), dt=1e-3, steps=10, every=5))
        >>> [round(state.time, 6) for state in states]
        [0.005, 0.01]
        """
        from kratos_lite.analysis.transient import TransientAnalysis

        return TransientAnalysis(self, **options)

    def quasi_static(self, **options: Any) -> QuasiStaticAnalysis:
        """Return the quasi-static analysis of the model: its loads grow in a pseudo-time.

        Parameters
        ----------
        options : those of `QuasiStaticAnalysis`, with the same errors.

        Returns
        -------
        QuasiStaticAnalysis
            ``kl.integrate(model.quasi_static(), dt=0.1, steps=10)`` takes its steps.
        """
        from kratos_lite.analysis.quasi_static import QuasiStaticAnalysis

        return QuasiStaticAnalysis(self, **options)

    def modes(
        self,
        count: int = 6,
        *,
        near: float | None = None,
        lumped: bool = False,
        preload: Preload | None = None,
        progress: Progress | None = None,
    ) -> tuple[Array, Array]:
        """Return natural frequencies and mode shapes.

        All supported degrees of freedom are fixed at zero.  A motion of the material is ignored: see
        `complex_modes`.  Laws that are not linear count with C, their tangent at rest, and no stress.  With a
        preload, its stress stiffens or softens: K + K_g takes the place of K, K_g = ∫ grad N·σ grad N dV;
        at a nonlinear result of its own the tangent does, with that of loads that follow.

        Parameters
        ----------
        count : number of modes.
        near : rad/s, find the modes nearest to this frequency; the lowest if not given.
        lumped : concentrate the mass at the nodes.
        preload : True for the loads of the model, other loads, or a result on its mesh; not with `near`.
        progress : called with the phase and the fraction done, 0 … 1.

        Returns
        -------
        frequencies : (count,) rad/s, ascending; near 0 for rigid-body modes.
        shapes : (count, n, 3), with φ·M φ = 1.

        Raises
        ------
        MeshError, ModelError, InputError
            If the model is broken, has no mass, has fewer modes, or is too large to factorize for `near`; or
            if the preload is beyond buckling or of laws with history, or leaves rigid motions free.
        SolveError
            If the iteration does not converge, or what it finds does not satisfy the equations.
        """
        from kratos_lite.analysis.modal import natural_modes

        with watched(progress) as shown:
            return natural_modes(self, count, lumped, near, preload, shown)

    def buckling(
        self, count: int = 5, *, preload: Preload = True, progress: Progress | None = None
    ) -> tuple[Array, Array]:
        """Return the factors λ of the loads at which the body buckles, and its shapes: (K + λ K_g) φ = 0.

        K_g is that of `modes`, with all of the stress, also that of temperature and prestress.  Loads keep
        their directions.  Factors < 0 belong to loads of the opposite sign, and are not found.

        Parameters
        ----------
        count : number of factors.
        preload, progress : as for `modes`.

        Returns
        -------
        factors : (count,), ascending; where one is < 1, the loads are beyond buckling.
        shapes : (count, n, 3), each with the largest displacement 1.

        Raises
        ------
        MeshError, ModelError, InputError
            If the model is broken or not linear, has a motion, no stress, rigid motions or fewer factors.
        SolveError
            If the iteration does not converge, as where loads only pull.
        """
        from kratos_lite.analysis.modal import buckling

        with watched(progress) as shown:
            return buckling(self, count, preload, shown)

    def harmonic(
        self,
        frequencies: ArrayLike,
        *,
        damping: ArrayLike = 0.0,
        rayleigh: tuple[float, float] = (0.0, 0.0),
        hysteretic: float = 0.0,
        loads: HarmonicLoads | None = None,
        method: str = "modes",
        modes: int | None = None,
        progress: Progress | None = None,
    ) -> HarmonicResponse:
        """Return the steady motion Re(u e^{iΩt}) under loads and prescribed displacements that swing.

        ((1 + iη) K + iΩ (α M + β K) - Ω² M) u = f, about a state at rest whose stress does not matter.

        Parameters
        ----------
        frequencies : Ω (f,) in rad/s, 2π times those in Hz.
        damping : ratio ζ < 1 of all modes, or of each, (modes,), 0.02 for 2 per cent; by modes alone.
        rayleigh : α in 1/s and β in s of the damping α M + β K.
        hysteretic : loss factor η of the stiffness (1 + iη) K.
        loads : each alone or with a complex factor, ``(load, 1j)``; those of the model if not given.
        method : ``modes`` with static correction: what they leave answers as K alone does; ``direct``: a
            factorization for each frequency.
        modes : number of modes; if not given, up to twice the largest frequency.
        progress : called with the phase and the fraction done, 0 … 1.

        Returns
        -------
        HarmonicResponse
            With amplitudes and phases at points, curves, and stresses at an instant.

        Raises
        ------
        MeshError, ModelError, InputError
            If the model is broken, has no mass, is not linear or has a motion; a load or support is no
            amplitude; its supports leave rigid motions free, by modes; or it is too large to factorize.
        SolveError
            If a frequency is that of an undamped mode, which it names, or the modes do not converge.

        Examples
        --------
        >>> import numpy as np, kratos_lite as kl
        >>> bar = kl.Model(kl.box((1, 0.1, 0.1), (8, 1, 1)), kl.Isotropic3D(E=1e6, nu=0.0, density=1.0))
        >>> bar.fix("x-")
        >>> bar.add(kl.Traction("x+", (1e3, 0, 0)))
        >>> u = bar.harmonic([0.0, 500.0], hysteretic=0.01).at((1, 0.05, 0.05))[:, 0]
        >>> exact = 2e-3 * float(np.tan(0.5))  # σ / (E k) tan k L
        >>> np.abs(u).round(5).tolist(), round(exact, 5)
        ([0.001, 0.00109], 0.00109)
        """
        from kratos_lite.analysis.harmonic import harmonic_response

        given = frequencies, damping, rayleigh, hysteretic, loads, method, modes
        with watched(progress) as shown:
            return harmonic_response(self, *given, shown)

    def complex_modes(
        self, count: int = 6, *, progress: Progress | None = None
    ) -> tuple[Complexes, Complexes]:
        """Return the complex modes of a model with its motion at the time 0: λ² M + λ C + K is singular.

        Parameters
        ----------
        count : number of modes.
        progress : called with the phase and the fraction done, 0 … 1.

        Returns
        -------
        eigenvalues : λ (count,) in 1/s, nearest to 0 first.
        shapes : (count, n, 3), complex.

        Raises
        ------
        MeshError, ModelError, InputError
            If the model is broken, has no mass, or has fewer modes.
        SolveError
            If the iteration does not converge, or what it finds does not satisfy the equations.
        """
        from kratos_lite.analysis.modal import complex_modes

        with watched(progress) as shown:
            return complex_modes(self, count, shown)

    def plot(self, path: str | Path | None = None, **options: Any) -> Any:
        """Draw the body; a notebook shows it, and it is written if a path is given.

        Parameters
        ----------
        path : picture to write; .png, .pdf or .svg.
        options : those of `kratos_lite.plot`, with the same errors.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from kratos_lite.analysis.plot import plot  # a quick start without it

        return plot(self, path, **options)

    # ---- the equations themselves --------------------------------------------------------------

    def matrices(
        self, *, time: float = 0.0, lumped: bool = False, rayleigh: tuple[float, float] = (0.0, 0.0)
    ) -> Matrices:
        """Return K, M, C, f and what supports do, as SciPy matrices, to solve them in another way.

        K of a law that is not linear is that of its C, the tangent at rest.

        Parameters
        ----------
        time : s, of loads, supports and motion.
        lumped : concentrate the mass at the nodes.
        rayleigh : α in 1/s and β in s of the damping α M + β K.

        Returns
        -------
        Matrices
            u = T q + c and T' M T q'' + T' C T q' + T' K T q = T' (f - K c - M c'' - C c').  A motion of the
            material adds its terms to K, C and f.

        Raises
        ------
        MeshError, ModelError, InputError
            If the model is broken; its supports may leave rigid-body modes free.

        Examples
        --------
        >>> import numpy as np
        >>> import kratos_lite as kl
        >>> from scipy.sparse.linalg import spsolve
        >>> model = kl.Model(kl.box(cells=(2, 2, 2)), kl.Isotropic3D(E=210e9, nu=0.3, density=7800.0))
        >>> model.fix("z-")
        >>> model.fix("z+", "x", 1e-3)
        >>> model.add(kl.Gravity((0, 0, -9.81)))
        >>> K, T, f, c = (getattr(model.matrices(), name) for name in ("K", "T", "f", "c"))
        >>> q = spsolve((T.T @ K @ T).tocsc(), T.T @ (f - K @ c))
        >>> u = (T @ q + c).reshape(-1, 3)
        >>> bool(np.abs(u - model.solve().u).max() < 1e-12 * np.abs(u).max())
        True
        """
        from kratos_lite.analysis.matrices import matrices_of

        return matrices_of(self, time, lumped, rayleigh)

    def local_system(self, element: int, u: ArrayLike | None = None) -> LocalSystem:
        """Return stiffness, residual and mass of an element, as ``CalculateLocalSystem`` of Kratos does.

        With the material, rule and prestress of the element in this model, and the body loads on it
        (`BodyForce`, `Gravity`, at the time 0): loads on faces and nodes are none of an element.  A motion of
        the material is left out.

        Parameters
        ----------
        element : id of the element.
        u : (n, 3) in m, displacements of all nodes; 0 if not given.

        Returns
        -------
        LocalSystem
            K (3k, 3k) in N/m, r = r_ext - r_int (3k,) in N, M (3k, 3k) in kg, and dofs (3k,), where they
            belong among those of the model.

        Raises
        ------
        MeshError, ModelError, InputError
            There is no such element, it has no material, or u has another shape.

        Examples
        --------
        >>> import kratos_lite as kl
        >>> model = kl.Model(kl.box(), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
        >>> model.add(kl.Gravity((0, 0, -10.0)))
        >>> K, r, M, dofs = model.local_system(1)
        >>> K.shape, round(float(r.sum()), 6), round(float(M.sum()), 6)
        ((24, 24), -10000.0, 3000.0)
        """
        from kratos_lite.analysis.matrices import local_system_of

        return local_system_of(self, element, u)
