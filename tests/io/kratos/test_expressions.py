"""Expressions of run files: values as Kratos 10.4.4 gives them, everything else refused."""

import sys
from importlib.util import find_spec

import numpy as np
import pytest
from children import output_of

from kratos_lite.io.kratos.expressions import evaluate

AT = {"x": 2.0, "y": 3.0, "z": 5.0, "t": 0.5, "X": 7.0, "Y": 11.0, "Z": 13.0}
KRATOS = {
    "-x^2": 4.0,
    "2^3^2": 64.0,
    "-x**2": 4.0,
    "2**3**2": 64.0,
    "2^-1": 0.5,
    "3-2^2": -1.0,
    "6/2*3": 9.0,
    "2-3-4": -5.0,
    "--x": 2.0,
    "2*-x": -4.0,
    "7%4": 3.0,
    "log(10)": 1.0,
    "ln(10)": 2.302585092994046,
    "exp(-t^2)": 1.2840254166877414,
    "x if t<1 else y": 2.0,
    "x if t>1 else y": 3.0,
    "X+Y+Z": 31.0,
    "1.e-3*.5E+1": 0.005,
    "7.8E-03": 0.0078,
    "sqrt(abs(-4))*pow(x,2)": 8.0,
    "atan2(1,1)*4-pi": 0.0,
    "sin(pi/2)+cos(0)+tan(0)": 2.0,
    "floor(1.5)+ceil(1.2)": 3.0,
    "e": 2.718281828459045,
    "(0.6)*((1.0+y)*t)": 1.2,
}


@pytest.mark.parametrize("text", KRATOS)
def test_kratos_dialect(text):
    assert evaluate(text, AT) == pytest.approx(KRATOS[text], rel=1e-15, abs=1e-15)


@pytest.mark.skipif(find_spec("KratosMultiphysics") is None, reason="Kratos is not installed")
def test_kratos_itself_gives_the_same_values():
    code = (
        "import KratosMultiphysics as KM\n"
        f"for text in {list(KRATOS)!r}:\n"
        "    f = KM.GenericFunctionUtility(text)\n"
        "    print('value', repr(f.CallFunction(2.0, 3.0, 5.0, 0.5, 7.0, 11.0, 13.0)))\n"
    )
    lines = output_of(sys.executable, "-c", code).splitlines()
    found = [float(line.split()[1]) for line in lines if line.startswith("value ")]
    assert found == pytest.approx(list(KRATOS.values()), rel=1e-15, abs=1e-15)


@pytest.mark.parametrize(
    "text",
    [
        *("-x**2", "2**3**2", "2**-1", "-2**2 + 7 % 4", "log(10)", "x if t<1 else y"),
        *("(x if t>1 else y if t>2 else z)*2", "min(x, y)*max(x, z)"),
    ],
)
def test_python_dialect(text):
    from math import log

    expected = eval(text, {"log": log, "min": min, "max": max}, dict(AT))
    assert evaluate(text, AT, python=True) == pytest.approx(expected, rel=1e-15)


def test_values_are_broadcast_over_arrays():
    x = np.array([0.0, 1.0, 2.0])
    np.testing.assert_array_equal(evaluate("x^2 if x<1.5 else -t", {"x": x, "t": 3.0}), [0.0, 1.0, -3.0])


@pytest.mark.parametrize(
    "text",
    [
        *(
            "",
            "x+",
            "2x",
            "x y",
            "x,y",
            "sin(x",
            "x))",
            "a",
            "sin",
            "x(2)",
            "pow(x)",
            "0x10",
            "1_0",
            "x.real",
        ),
        *("x<y", "x if t<1", "x if t else y", "__import__('os')", "().__class__", "x; y", "x = 1", "'a'"),
        *("[x]", "1/0", "log(0)", "sqrt(-1)", "9^9^9^9", "x\0", "١"),
        *("(" * 100_000, "-" * 100_000, "(" * 60 + "x" + ")" * 60),
    ],
)
@pytest.mark.parametrize("python", [False, True])
def test_anything_else_is_refused_with_the_text(text, python):
    with pytest.raises(ValueError, match=r"^expression "):
        evaluate(text, AT, python)


@pytest.mark.parametrize("text", ["x if t>1 else y if t>2 else z", "2*(x if t<1 else y)"])
def test_choices_that_kratos_misreads_or_refuses_are_refused(text):
    with pytest.raises(ValueError, match="one 'if' at the outermost level"):
        evaluate(text, AT)
