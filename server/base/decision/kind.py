"""A kind of decision: one task of a worker, which depends on nothing but what it is given."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from autonomy.planner.plan import Pace

P = TypeVar("P")
R = TypeVar("R")


def _no_seed(problem: object) -> tuple[int, ...]:
    del problem
    return ()


def _no_pace(result: object) -> Pace | None:
    del result
    return None


def _as_it_is(problem: P, pace: Pace) -> P:
    del pace
    return problem


@dataclass(frozen=True, slots=True)
class DecisionKind(Generic[P, R]):
    """How the decisions of one kind are kept and repeated."""

    key: str
    title: str
    """What was decided, as people read it: "Plan", ..."""
    task: str
    """Name of the worker's task; its only clock is a ``Pace``."""
    problem: type[P]
    outcome: Callable[[R], object]
    """Returns what counts of a result, as JSON with numbers that may be quantized."""
    map_parts: tuple[str, ...]
    """Where the problem has the map: names of fields, with dots within."""
    seed: Callable[[P], tuple[int, ...]] = _no_seed
    """Returns what its random numbers begin with, empty where it draws none."""
    pace: Callable[[R], Pace | None] = _no_pace
    """Returns how far a result came by the clock."""
    paced: Callable[[P, Pace], P] = _as_it_is
    """Returns the problem that ends there."""
    candidates: Callable[[R], int | None] = lambda _: None
    """Returns how many were compared."""


def part_of(tree: Mapping[str, Any], path: str) -> Any:  # noqa: ANN401 - any JSON
    """Return what a problem's JSON has at a path with dots."""
    found: Any = tree
    for name in path.split("."):
        found = found[name]
    return found
