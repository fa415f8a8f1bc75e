"""Findings: what each check measured, and the text that tells a student what to fix."""

from __future__ import annotations

import math
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from kratos_lite.errors import MAX_PROBLEMS, KratosLiteError

PYTHON = Path(traceback.__file__).parent

CURES = {
    "truth value of an array": "many points come at once: np.where(condition, a, b) chooses for each",
    "mismatch in its core dimension": "many points come at once, strain (…, 6): strain @ C",
    "response() takes": "a law has response(self, strain, state, dt)",
    "local_system() takes": "an element has local_system(self, C, u)",
    "LinAlgError": "K is singular, or no matrix of numbers; mend what fails before",
}
"""What to do about errors of Python that say this."""

S = TypeVar("S")
T = TypeVar("T")


class ConformanceError(KratosLiteError):
    """An element, a shape or a material does not do what theory demands."""


class Measured(NamedTuple):
    """What a check measured, the largest value that passes, and where it was measured."""

    value: float
    limit: float
    detail: str


@dataclass(frozen=True)
class Finding:
    """The result of one check.

    Attributes
    ----------
    check : short name, such as ``derivatives``.
    passed : whether `measured` ≤ `limit`; False for a check that was not run.
    measured, limit : numbers; relative errors or counts, as `detail` says.
    detail : where the largest error is, or why the check was not run.
    skipped : True if the check was not run: then nothing is known, good or bad.
    claim : what holds if the check passes.
    """

    check: str
    passed: bool
    measured: float
    limit: float
    detail: str
    skipped: bool = False
    claim: str = ""

    def __str__(self) -> str:
        if self.skipped:
            return f"{self.check}: not run: {self.detail}"
        text = (self.passed and self.claim) or self.detail
        if self.limit == 0:  # a count of faults, or none at all
            return f"{self.check}: {text}"
        return (
            f"{self.check}: {self.measured:.3g} {'≤' if self.passed else 'exceeds'} {self.limit:.3g}: {text}"
        )


def failures(findings: Iterable[Finding]) -> list[Finding]:
    """Return the findings of checks that were run and did not pass.

    Parameters
    ----------
    findings : those of one subject or several.

    Returns
    -------
    list of Finding

    Examples
    --------
    >>> failures([Finding("rank", True, 0, 0, ""), Finding("patch", False, 1, 0, "why", skipped=True)])
    []
    """
    return [finding for finding in findings if not finding.passed and not finding.skipped]


def report(name: str, findings: list[Finding], *, whole: bool = False) -> str:
    """Return the text that counts the findings of a subject and shows its failures.

    Parameters
    ----------
    name : of the subject.
    findings : those of its checks.
    whole : show also what passed, after the failures, and then in one line what was not run.

    Returns
    -------
    str

    Examples
    --------
    >>> print(report("Wedge6", [Finding("kronecker", True, 0.0, 1e-14, "")]))
    Wedge6 conforms: 1 check passed
    """
    bad, skipped = failures(findings), sum(finding.skipped for finding in findings)
    run = len(findings) - skipped
    aside = f", {skipped} not run" if skipped else ""
    lines = [f"{name} conforms: {run} check{'s' * (run != 1)} passed{aside}"]
    if skipped and not run:
        lines = [f"{name}: nothing was checked"]
    if bad:
        lines = [f"{name} does not conform: {len(bad)} of {run} checks failed{aside}"]
    lines += [f"  FAILED  {finding}" for finding in bad[:MAX_PROBLEMS]]
    if len(bad) > MAX_PROBLEMS:
        lines.append(f"  … and {len(bad) - MAX_PROBLEMS} more")
    if whole:
        lines += [f"  ok      {finding}" for finding in findings if finding.passed]
        lines += [f"  not run {_reasons(findings)}"] if skipped else []
    return "\n".join(lines)


def _reasons(findings: Iterable[Finding]) -> str:
    """Return why checks were not run, those of one reason together."""
    checks: dict[str, list[str]] = {}
    for finding in findings:
        if finding.skipped:
            checks.setdefault(finding.detail, []).append(finding.check)
    few = 3
    return "; ".join(
        f"{', '.join(names) if len(names) <= few else f'{len(names)} checks'} ({why})"
        for why, names in checks.items()
    )


def run(checks: Iterable[Callable[[S], Measured | str]], subject: S) -> list[Finding]:
    """Run checks on a subject; what it raises is a failed finding, the same error again a skipped one."""
    findings: list[Finding] = []
    first: dict[str, str] = {}
    for check in checks:
        finding = _run_one(check, subject)
        if finding.detail.startswith("raises ") and "LinAlgError" not in finding.detail:
            seen = first.setdefault(finding.detail, finding.check)
            if seen != finding.check:
                finding = _not_run(finding.check, f"stops at the same error as {seen!r}")
        findings.append(finding)
    return findings


def run_after(
    causes: Iterable[Finding], checks: Iterable[Callable[[S], Measured | str]], subject: S
) -> list[Finding]:
    """Run checks that only mean something if others passed; after a failure they are not run, and say so."""
    names = [finding.check for finding in failures(causes)]
    if not names:
        return run(checks, subject)
    return [_not_run(title(check), f"fix {', '.join(names)} first") for check in checks]


def title(check: Callable[..., object]) -> str:
    """Return the name of a check as findings show it."""
    return check.__name__.replace("_", " ")


def _not_run(check: str, why: str) -> Finding:
    return Finding(check, False, math.nan, math.nan, why, skipped=True)


def _claim(check: Callable[..., object]) -> str:
    """Return the first line of the docstring of a check, as a statement."""
    line = (check.__doc__ or "").strip().partition("\n")[0].rstrip(".")
    return line.removeprefix("Check that ").removeprefix("Check for ").removeprefix("Check ")


def _run_one(check: Callable[[S], Measured | str], subject: S) -> Finding:
    name = title(check)
    try:
        with np.errstate(all="ignore"):  # a result that is not finite fails its check anyway
            result = check(subject)
    except Exception as error:
        return Finding(name, False, math.inf, 0.0, f"raises {describe(error)}")
    if isinstance(result, str):
        return _not_run(name, result)
    value, limit = float(result.value), float(result.limit)
    return Finding(name, value <= limit, value, limit, result.detail, claim=_claim(check))


def describe(error: Exception) -> str:
    """Return an error as one text, with the last line of the student's own code that led to it."""
    frames = traceback.extract_tb(error.__traceback__)
    libraries = {Path(__file__).parents[1], Path(np.__file__).parent}
    files = [(Path(frame.filename), frame.lineno) for frame in frames]
    theirs = [f for f in files if not libraries & set(f[0].parents) and f[0].parent != PYTHON]
    place = f" at {theirs[-1][0].name}:{theirs[-1][1]}" if theirs else ""
    kind = "" if isinstance(error, ConformanceError) else f"{type(error).__name__}: "
    text = f"{kind}{error}{place}"
    return "; ".join([text, *(cure for sign, cure in CURES.items() if sign in text)])


def difference(found: ArrayLike, expected: ArrayLike) -> float:
    """Return max |found - expected| / max |expected|, two-sided; infinite where the sizes differ."""
    a, b = np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
    if a.shape != b.shape:
        raise ConformanceError(f"a result has shape {a.shape}; expected {b.shape}")
    return float(np.abs(a - b).max(initial=0.0) / np.abs(b).max(initial=1e-300))


def worst(errors: Mapping[T, float]) -> tuple[float, T]:
    """Return the largest error and what it belongs to; one that is not a number counts as largest."""
    names = list(errors)
    i = int(np.argmax([errors[name] for name in names]))
    return float(errors[names[i]]), names[i]


def largest(errors: Mapping[str, float], limit: float) -> Measured:
    """Return the largest of errors by what they belong to."""
    error, detail = worst(errors)
    return Measured(error, limit, detail)


def at(xi: ArrayLike) -> str:
    """Return a point as text."""
    return "(" + ", ".join(f"{x:.6g}" for x in np.asarray(xi, dtype=float).tolist()) + ")"
