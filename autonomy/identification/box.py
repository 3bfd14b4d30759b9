"""The box of a search: who stands at its border, and how it grows there."""

from collections.abc import Sequence
from dataclasses import replace

from autonomy.arrays import FloatArray
from autonomy.identification.problem import Problem
from autonomy.identification.unknown import SIGN_KEPT, Unknown

_AT = 1e-9
_GROWTH = 2.0
_LEAST_SHARE = 0.02
"""Part of its present value to which a parameter that keeps its sign may fall."""


def at_border(sought: Sequence[Unknown], u: FloatArray) -> tuple[int, ...]:
    """Return the places of the unknowns that stand at the border of the box.

    Args:
        sought: The unknowns.
        u: Their values in units of their scales, shape ``(n,)``.
    """
    return tuple(
        k for k, unknown in enumerate(sought) if min(u[k] - unknown.low, unknown.high - u[k]) < _AT
    )


def widened(problem: Problem, u: FloatArray) -> Problem | None:
    """Return the problem with more room for what stands at the border; None if there is no more.

    Where a border goes away from 0 it doubles its distance from the present value; where it goes
    towards 0 and the sign must stay, it halves the value.

    Args:
        problem: The fit.
        u: Where the search stands, shape ``(n,)``.
    """
    sought = list(problem.sought)
    for k in at_border(problem.sought, u):
        sought[k] = _widened(sought[k], float(u[k]), problem.config.widest_share)
    wider = tuple(sought)
    return None if wider == problem.sought else replace(problem, sought=wider)


def _widened(unknown: Unknown, u: float, widest: float) -> Unknown:
    if unknown.high - u < _AT:
        return replace(unknown, high=_further(unknown, unknown.high, 1.0, widest))
    return replace(unknown, low=-_further(unknown, -unknown.low, -1.0, widest))


def _further(unknown: Unknown, distance: float, way: float, widest: float) -> float:
    """Return the next distance of a border from the present value, not below the last."""
    next_one = min(_GROWTH * distance, widest)
    if unknown.name in SIGN_KEPT and way * unknown.nominal < 0.0:
        next_one = min(next_one, 1.0 - max((1.0 - distance) / _GROWTH, _LEAST_SHARE))
    return max(next_one, distance)


def borders(problem: Problem) -> list[list[float]]:
    """Return the box in JSON's types."""
    return [[unknown.low, unknown.high] for unknown in problem.sought]


def with_borders(problem: Problem, box: Sequence[Sequence[float]]) -> Problem:
    """Return the problem with the box that ``borders`` wrote."""
    sought = tuple(
        replace(unknown, low=float(low), high=float(high))
        for unknown, (low, high) in zip(problem.sought, box, strict=True)
    )
    return replace(problem, sought=sought)
