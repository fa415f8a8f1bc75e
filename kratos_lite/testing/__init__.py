"""Conformance kit: checks that any shape, rule, element or material of your own must pass.

Each ``check_…`` function returns one `Finding` per check, whatever the subject does;
`assert_conforms` raises one readable error instead, for use in a test.

Examples
--------
>>> from kratos_lite import KinematicLinear3D10N
>>> assert_conforms(KinematicLinear3D10N)
"""

from __future__ import annotations

from kratos_lite.elements import KinematicLinear
from kratos_lite.errors import InputError
from kratos_lite.materials import Material
from kratos_lite.shapes import Shape
from kratos_lite.testing.elements import check_element as check_element
from kratos_lite.testing.files import run_file as run_file
from kratos_lite.testing.materials import check_material as check_material
from kratos_lite.testing.report import ConformanceError as ConformanceError
from kratos_lite.testing.report import Finding as Finding
from kratos_lite.testing.report import failures as failures
from kratos_lite.testing.report import report as report
from kratos_lite.testing.rules import check_rule as check_rule
from kratos_lite.testing.shapes import check_shape as check_shape


def check(subject: type[KinematicLinear] | type[Shape] | Material) -> tuple[str, list[Finding]]:
    """Check an element class, a shape class or a material instance.

    Parameters
    ----------
    subject : what to check.

    Returns
    -------
    (str, list of Finding)
        The name of the subject and one finding for each check.

    Raises
    ------
    InputError
        If the subject is not one of these.
    """
    if isinstance(subject, Material):
        return type(subject).__name__, check_material(subject)
    if isinstance(subject, type) and issubclass(subject, KinematicLinear):
        return subject.__name__, check_element(subject)
    if isinstance(subject, type) and issubclass(subject, Shape):
        return subject.__name__, check_shape(subject)
    raise InputError(f"check an element class, a shape class or a material instance; got {subject!r}")


def assert_conforms(subject: type[KinematicLinear] | type[Shape] | Material) -> None:
    """Raise ConformanceError with every failed check unless the subject passes all that can run.

    Parameters
    ----------
    subject : element class, shape class or material instance.

    Raises
    ------
    ConformanceError
        With the text of `report`: each failed check, what it measured and where.
    InputError
        If the subject is not one of these.
    """
    name, findings = check(subject)
    if failures(findings):
        raise ConformanceError(report(name, findings))
