"""Expressions over channels and values: numbers in, one number out, and nothing else can happen.

The text is parsed by Python's own parser and never run by it: each node of a short list becomes a
closure, any other is refused. There is no loop, no attribute, no text and no power, so that a rule
ends after as many steps as it has nodes.

An unknown number (NaN) makes unknown what depends on it, and an unknown condition raises nothing;
but ``0 and unknown`` is 0 and ``1 or unknown`` is 1, as in three-valued logic.
"""

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

LENGTH_MAX: Final = 400
NODES_MAX: Final = 120
DEPTH_MAX: Final = 24
NUMBER_MAX: Final = 1e15
_LETTERS: Final = re.compile(r"[A-Za-z0-9_ .+\-*/()<>=!,]*")
_HOLDS: Final = "numbers, names of channels, + - * /, < <= > >= == !=, and, or, not, abs, min, max"

Lookup = Callable[[str], float]
"""Returns the newest value of a name, NaN where nobody knows it."""
Term = Callable[[Lookup], float]


class ExpressionError(ValueError):
    """The text is no expression that a rule may have; the message says where it is wrong."""


@dataclass(frozen=True, slots=True)
class Expression:
    """A compiled expression."""

    text: str
    names: frozenset[str]
    """What it reads."""
    value: Term
    """Its value; a condition is 1 or 0, and what cannot be known NaN."""


def compile_expression(text: str) -> Expression:
    """Compile an expression.

    Raises:
        ExpressionError: If it is too long, cannot be parsed, or holds anything that is not listed.
    """
    if len(text) > LENGTH_MAX:
        raise ExpressionError(f"may have {LENGTH_MAX} characters; has {len(text)}")
    if not _LETTERS.fullmatch(text):
        odd = next(letter for letter in text if not _LETTERS.fullmatch(letter))
        raise ExpressionError(f"holds {odd!r}; it may hold {_HOLDS}")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(text.strip(), mode="eval")
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ExpressionError("cannot be read as an expression") from error
    nodes = sum(1 for _ in ast.walk(tree))
    if nodes > NODES_MAX:
        raise ExpressionError(f"may have {NODES_MAX} parts; has {nodes}")
    names: set[str] = set()
    term = _term(tree.body, names, 0)
    return Expression(text, frozenset(names), term)


def _term(node: ast.expr, names: set[str], depth: int) -> Term:
    if depth > DEPTH_MAX:
        raise ExpressionError(f"may be nested {DEPTH_MAX} deep")
    below = depth + 1
    match node:
        case ast.Constant(value=value):
            return _number(value)
        case ast.Name(id=name):
            names.add(name)
            return lambda lookup: lookup(name)
        case ast.UnaryOp(op=op, operand=operand):
            return _unary(op, _term(operand, names, below))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
            return _binary(
                _ARITHMETIC[type(op)], _term(left, names, below), _term(right, names, below)
            )
        case ast.BoolOp(op=op, values=values):
            terms = [_term(one, names, below) for one in values]
            return _chain(terms, stops=0.0 if isinstance(op, ast.And) else 1.0)
        case ast.Compare(left=left, ops=ops, comparators=others):
            terms = [_term(one, names, below) for one in (left, *others)]
            return _comparison(terms, ops)
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in _FUNCTIONS:
            return _call(name, [_term(one, names, below) for one in args])
        case _:
            what = ast.unparse(node)[:40]
            raise ExpressionError(f"holds {what!r}; it may hold {_HOLDS}")


def _number(value: object) -> Term:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ExpressionError(f"holds {value!r}, which is no number")
    if not abs(value) <= NUMBER_MAX:
        raise ExpressionError(f"holds a number beyond {NUMBER_MAX:g}")
    number = float(value)
    return lambda lookup: number


def _unary(op: ast.unaryop, term: Term) -> Term:
    if isinstance(op, ast.USub):
        return lambda lookup: -term(lookup)
    if isinstance(op, ast.UAdd):
        return term
    if isinstance(op, ast.Not):
        return lambda lookup: _as_condition(term(lookup), negated=True)
    raise ExpressionError(f"holds '~'; it may hold {_HOLDS}")


def _as_condition(value: float, *, negated: bool = False) -> float:
    return value if math.isnan(value) else float((value != 0.0) is not negated)


def _divided(left: float, right: float) -> float:
    return left / right if right else math.nan


_ARITHMETIC: Final[dict[type[ast.operator], Callable[[float, float], float]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: _divided,
}
_COMPARISONS: Final[dict[type[ast.cmpop], Callable[[float, float], bool]]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_FUNCTIONS: Final[dict[str, Callable[[list[float]], float]]] = {
    "abs": lambda values: abs(values[0]),
    "min": min,
    "max": max,
}


def _binary(act: Callable[[float, float], float], left: Term, right: Term) -> Term:
    return lambda lookup: act(left(lookup), right(lookup))


def _chain(terms: list[Term], stops: float) -> Term:
    """Return ``and`` (which a 0 ends) or ``or`` (which a 1 ends)."""

    def value(lookup: Lookup) -> float:
        found = 1.0 - stops
        for term in terms:
            one = _as_condition(term(lookup))
            if one == stops:
                return stops
            if math.isnan(one):
                found = one
        return found

    return value


def _comparison(terms: list[Term], ops: list[ast.cmpop]) -> Term:
    unknown = next((op for op in ops if type(op) not in _COMPARISONS), None)
    if unknown is not None:
        raise ExpressionError(f"holds a comparison that is none of {_HOLDS}")
    acts = [_COMPARISONS[type(op)] for op in ops]

    def value(lookup: Lookup) -> float:
        left = terms[0](lookup)
        for act, term in zip(acts, terms[1:], strict=True):
            right = term(lookup)
            if math.isnan(left) or math.isnan(right):
                return math.nan
            if not act(left, right):
                return 0.0
            left = right
        return 1.0

    return value


def _call(name: str, terms: list[Term]) -> Term:
    function, least = _FUNCTIONS[name], 1 if name == "abs" else 2
    if len(terms) < least or (name == "abs" and len(terms) > 1):
        raise ExpressionError(f"{name} takes {'one part' if name == 'abs' else 'two or more'}")

    def value(lookup: Lookup) -> float:
        values = [term(lookup) for term in terms]
        return math.nan if any(map(math.isnan, values)) else function(values)

    return value
