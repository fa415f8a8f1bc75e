"""Progress is reported in every phase, and an error of the function that it is reported to ends the work."""

from contextlib import suppress

import pytest

import kratos_lite as kl
from kratos_lite.ale import Translation


def held(**options):
    model = kl.Model(kl.box(cells=(4, 4, 4)), kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0), **options)
    model.fix("z-")
    model.add(kl.Gravity((0, 0, -10.0)))
    return model


def moving():
    model = held()
    model.add(Translation("x", rate=1.0, boundaries="natural"))
    return model


def stepped(progress):
    return list(kl.integrate(held().transient(progress=progress), 1e-4, 3, progress=progress))


STATIC = {"check", "load", "assemble", "solve", "verify"}
MODES = {"check", "assemble", "modes"}
CASES = {"own": kl.Gravity((0, 0, -1.0))}
WORK = {
    "dense": (lambda progress: held().solve("dense", progress=progress), STATIC | {"factorize"}),
    "direct": (lambda progress: held().solve("direct", progress=progress), STATIC | {"factorize"}),
    "multigrid": (lambda progress: held().solve("amg", progress=progress), STATIC | {"set up"}),
    "cases": (lambda progress: held().solve_cases(CASES, progress=progress), STATIC),
    "adaptive": (lambda progress: held().solve(error=0.2, progress=progress), STATIC),
    "steady": (lambda progress: moving().solve(progress=progress), STATIC | {"factorize"}),
    "modes": (lambda progress: held().modes(2, progress=progress), MODES),
    "complex modes": (lambda progress: moving().complex_modes(2, progress=progress), MODES),
    "steps": (stepped, {"assemble", "factorize", "integrate"}),
}


@pytest.mark.parametrize("work", WORK)
def test_every_phase_is_reported_from_its_begin_to_its_end(work):
    calls, (run, phases) = [], WORK[work]
    run(lambda phase, share: calls.append((phase, share)))
    assert phases <= {phase for phase, _ in calls}
    assert all(0 <= share <= 1 for _, share in calls)
    last = dict(calls)
    assert {phase for phase, share in last.items() if share != 1} == set()


@pytest.mark.parametrize("method", ["modes", "complex_modes"])
def test_an_iteration_for_modes_reports_each_step(method):
    mesh = kl.box((1.0, 1.0, 1.0), (8, 8, 8))
    model = kl.Model(mesh, kl.Isotropic3D(E=1e9, nu=0.3, density=1000.0))
    model.fix("z-")
    calls = []
    getattr(model, method)(2, progress=lambda phase, share: calls.append((phase, share)))
    shares = [share for phase, share in calls if phase == "modes"]
    assert len(shares) > 6
    assert shares == sorted(shares)


@pytest.mark.parametrize(
    ("work", "phase"), [(work, phase) for work, (_, phases) in WORK.items() for phase in sorted(phases)]
)
def test_an_error_in_any_phase_comes_through(work, phase):
    class Stop(Exception):
        pass

    def stop(now, _):
        if now == phase:
            raise Stop

    with pytest.raises(Stop):
        WORK[work][0](stop)


def test_an_analysis_can_be_used_again_after_it_was_stopped_in_any_phase():
    expected, stops = held().solve("amg").u, []

    def stop(phase, _):
        if phase not in stops:
            stops.append(phase)
            raise KeyboardInterrupt

    analysis = result = None
    while result is None:
        with suppress(KeyboardInterrupt):
            analysis = analysis or held().static("amg", progress=stop)
            result = analysis.solve()
    assert {"check", "load", "assemble", "set up", "solve", "verify"} <= set(stops)
    assert abs(result.u - expected).max() <= 1e-12 * abs(expected).max()


@pytest.mark.parametrize("method", ["modes", "complex_modes"])
def test_progress_of_modes_must_be_a_function(method):
    with pytest.raises(kl.InputError, match="progress must be a function"):
        getattr(moving(), method)(1, progress=3)
