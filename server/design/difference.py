"""How two designs, or a design and a plan, differ: field by field and leg by leg."""

import math
from collections.abc import Iterator, Mapping, Sequence
from difflib import SequenceMatcher
from typing import Any

from autonomy.design.document import Design
from server.design.view import FieldChangeView, LegChangeView, OutlineLegView

_SAME_M = 1e-3
_NEAR_S = 0.5


def field_changes(first: Design, second: Design) -> list[FieldChangeView]:
    """Return the fields of two documents that differ, in the order of the first."""
    before = dict(_fields(first.model_dump(mode="json")))
    after = dict(_fields(second.model_dump(mode="json")))
    paths = [*before, *(path for path in after if path not in before)]
    return [
        FieldChangeView(path, _title(path), _text(before, path), _text(after, path))
        for path in paths
        if before.get(path) != after.get(path)
    ]


def leg_changes(
    first: Sequence[OutlineLegView], second: Sequence[OutlineLegView]
) -> list[LegChangeView]:
    """Return how the legs of two ways differ, both in order.

    Legs that lead from the same place to the same place are the same; between those, legs are
    compared one by one, and what is left over was added or removed.
    """
    found: list[LegChangeView] = []
    matcher = SequenceMatcher(
        None, [_key(leg) for leg in first], [_key(leg) for leg in second], autojunk=False
    )
    for tag, i1, i2, j1, j2 in matcher.get_opcodes():
        if tag == "equal":
            pairs = zip(range(i1, i2), range(j1, j2), strict=True)
            found += [_compared(first[i], second[j]) for i, j in pairs]
            continue
        both = min(i2 - i1, j2 - j1)
        found += [_compared(first[i1 + k], second[j1 + k]) for k in range(both)]
        for leg in first[i1 + both : i2]:
            found.append(LegChangeView("removed", leg.number, None, None, f"{_named(leg)} is gone"))
        for leg in second[j1 + both : j2]:
            found.append(LegChangeView("added", None, leg.number, None, f"{_named(leg)} is new"))
    return found


def _key(leg: OutlineLegView) -> tuple[str, tuple[float, ...], tuple[float, ...]]:
    start, end = (tuple(round(part, 3) for part in place) for place in (leg.start_ned, leg.end_ned))
    return leg.kind, start, end


def _compared(first: OutlineLegView, second: OutlineLegView) -> LegChangeView:
    moved_m = math.dist(first.end_ned, second.end_ned)
    said: list[str] = []
    if first.kind != second.kind:
        said.append(f"a {second.kind} instead of a {first.kind}")
    if abs(first.end_ned[2] - second.end_ned[2]) > _SAME_M:
        said.append(f"ends at {second.end_ned[2]:.4g} m instead of {first.end_ned[2]:.4g} m")
    across_m = math.dist(first.end_ned[:2], second.end_ned[:2])
    if across_m > _SAME_M:
        said.append(f"ends {across_m:.4g} m away")
    if abs(first.duration_s - second.duration_s) > _NEAR_S:
        said.append(f"takes {second.duration_s:.0f} s instead of {first.duration_s:.0f} s")
    change = "moved" if moved_m > _SAME_M else "changed" if said else "same"
    return LegChangeView(change, first.number, second.number, moved_m, "; ".join(said))


def _named(leg: OutlineLegView) -> str:
    return f"leg {leg.number + 1}, a {leg.kind},"


def _fields(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:  # noqa: ANN401 - JSON
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _fields(inner, f"{path}/{key}")
    elif isinstance(value, list):
        for number, inner in enumerate(value):
            yield from _fields(inner, f"{path}/{number}")
    else:
        yield path, value


def _title(path: str) -> str:
    """Return a pointer as a person reads it: ``/content/waypoints/3/north_m`` as waypoint 4."""
    words: list[str] = []
    for part in path.split("/")[2:]:
        if part.isdigit() and words:
            words[-1] = f"{words[-1].removesuffix('s')} {int(part) + 1}"
        else:
            words.append(part.replace("_", " "))
    return ", ".join(words) or path.strip("/")


def _text(fields: Mapping[str, Any], path: str) -> str | None:
    value = fields.get(path)
    return None if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
