"""State machines as tables: the one in a module's docstring is the one that the program follows."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from types import MappingProxyType
from typing import TypeVar

E = TypeVar("E", bound=StrEnum)
_GAP = re.compile(r"\s{2,}")


@dataclass(frozen=True, slots=True)
class Step:
    """What follows from one piece of evidence in one state."""

    state: str
    event: str


def transitions(doc: str | None, evidence: type[E]) -> Mapping[tuple[str, E], Step]:
    """Return the table of a docstring; a pair that is not in it changes nothing.

    Args:
        doc: Text with one table between rulers of ``=``. Its columns are the states in which the
            evidence counts (separated by commas), the evidence, the state that follows, the event.
        evidence: Every kind of evidence.

    Raises:
        ValueError: If the table is missing, names unknown evidence, or says a pair twice.
    """
    lines = [line.strip() for line in (doc or "").splitlines()]
    rulers = [number for number, line in enumerate(lines) if line.startswith("===")]
    if len(rulers) != len(("above the head", "below it", "at the end")):
        raise ValueError("the docstring has no table of transitions")
    found: dict[tuple[str, E], Step] = {}
    for line in lines[rulers[1] + 1 : rulers[2]]:
        states, what, state, event = _GAP.split(line)
        for before in states.split(", "):
            pair = (before, evidence(what))
            if pair in found:
                raise ValueError(f"{pair} is there twice")
            found[pair] = Step(state, event)
    return MappingProxyType(found)
