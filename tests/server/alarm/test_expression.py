"""Expressions compute, and can do nothing else, whatever somebody types."""

import math
import operator

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from server.alarm.expression import (
    LENGTH_MAX,
    ExpressionError,
    compile_expression,
)

KNOWN = {"depth_m": 12.0, "pressure": 1100.0, "leak": 0.0, "unknown": math.nan}


def value(text):
    return compile_expression(text).value(KNOWN.__getitem__)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("pressure > 1050 and depth_m > 1", 1.0),
        ("pressure > 1050 and not depth_m > 1", 0.0),
        ("0 < depth_m <= 12 and leak == 0", 1.0),
        ("max(depth_m, 20) - min(3, 4, 5) * abs(-2) / 4", 18.5),
        ("depth_m != 12 or leak", 0.0),
        ("-depth_m + +2", -10.0),
    ],
)
def test_an_expression_has_its_value(text, expected):
    assert value(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("unknown > 1", math.nan),
        ("unknown > 1 and depth_m > 20", 0.0),
        ("unknown > 1 or depth_m > 1", 1.0),
        ("not unknown", math.nan),
        ("max(unknown, 3)", math.nan),
        ("depth_m / leak", math.nan),
        ("unknown != unknown", math.nan),
    ],
)
def test_what_nobody_knows_makes_unknown_what_depends_on_it(text, expected):
    assert value(text) == pytest.approx(expected, nan_ok=True)


HOSTILE = (
    "__import__('os').system('true')", "().__class__", "depth_m.real", "depth_m[0]", "[1, 2]",
    "lambda: 1", "(x := 1)", "9 ** 9 ** 9", "1 << 99", "7 // 2", "7 % 2", "'a' * 9", "f'{depth_m}'",
    "open(1)", "max(1)", "max(*depth_m)", "max(1, 2, key=abs)", "abs(1, 2)", "abs()",
    "(abs)(1) if 1 else 2", "{1: 2}", "x for x in y", "1; 2", "True and False", "None", "1j",
    "1e400",
    "depth_m is 1", "1 in depth_m", "~1", "await depth_m", "yield", "import os", "", "   ", "\x00",
    "depth_m\n+1", "(" * 300, "-" * 399 + "1", "not " * 90 + "1", "1" * (LENGTH_MAX + 1),
    "depth_m # no",
    "eval(1)", "exec(1)", "getattr(depth_m, 1)", "print(1, 2)", "1 if depth_m else 2", "a.b(1)",
)  # fmt: skip


@pytest.mark.parametrize("text", HOSTILE)
def test_what_is_no_such_expression_is_refused(text):
    with pytest.raises(ExpressionError):
        compile_expression(text)


@given(st.text(max_size=LENGTH_MAX + 50))
def test_any_text_is_refused_or_computes_a_number(text):
    _refused_or_number(text)


_WORDS = st.sampled_from(
    ["depth_m", "leak", "1", "2.5", "(", ")", "+", "-", "*", "/", "**", "<", "==", "and", "or",
     "not", "abs", "max", "min", ",", ".", "[", "]", "__class__", "lambda", ":", "=", "if", "else"]
)  # fmt: skip


@given(st.lists(_WORDS, max_size=60).map(" ".join))
def test_any_string_of_its_words_is_refused_or_computes_a_number(text):
    _refused_or_number(text)


def _refused_or_number(text):
    asked: list[str] = []

    def lookup(name):
        asked.append(name)
        return 1.5

    try:
        found = compile_expression(text)
    except ExpressionError:
        return
    assert isinstance(found.value(lookup), float | int)
    assert set(asked) <= found.names


_SIGNS = {"+": operator.add, "-": operator.sub, "*": operator.mul, "<": operator.lt}
_numbers = st.integers(-99, 99).map(float)


@given(
    st.recursive(
        _numbers, lambda inner: st.tuples(inner, st.sampled_from("+-*<"), inner), max_leaves=12
    )
)
def test_arithmetic_is_that_of_numbers(tree):
    def text(node):
        if isinstance(node, float):
            return f"({node})"
        return f"({text(node[0])} {node[1]} {text(node[2])})"

    def expected(node):
        if isinstance(node, float):
            return node
        return float(_SIGNS[node[1]](expected(node[0]), expected(node[2])))

    assume(len(text(tree)) <= LENGTH_MAX)
    assert value(text(tree)) == expected(tree)
