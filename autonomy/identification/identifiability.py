"""Which parameters the data can tell, and in plain words which they cannot."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from autonomy.arrays import BoolArray, FloatArray
from autonomy.identification.box import at_border
from autonomy.identification.normal_equations import Information
from autonomy.identification.result import Verdict
from autonomy.identification.unknown import Unknown

_WEAK = 0.05
"""A standard deviation beyond this part of a parameter's value makes it weak."""
_NULL = 1.0
"""A direction whose standard deviation exceeds the values themselves is not in the data."""
FEWEST_SEGMENTS = 6
"""Fewer parts of a recording cannot contradict each other: what they say alike may be wrong."""
_MOST_NAMED = 5
_CORRELATED = 0.2
"""From this correlation on an unknown goes along with another that the box holds back."""
_PULLED = 0.3
"""So does one that would move by more than this part of its deviation if the box let go."""


@dataclass(frozen=True, slots=True)
class Direction:
    """A combination of unknowns that the data tell badly or not at all."""

    std: float
    """Standard deviation along it, in units of the scales; infinite if nothing is told."""
    members: tuple[int, ...]
    """Unknowns that take part, the strongest first."""
    message: str

    @property
    def is_null(self) -> bool:
        """Whether the data say nothing of it."""
        return self.std > _NULL


@dataclass(frozen=True, slots=True)
class Judgement:
    """What the data tell of one unknown."""

    verdict: Verdict
    std: float
    """Standard deviation in units of the scale; infinite if it is not identifiable."""
    reason: str
    held_by: tuple[int, ...] = ()
    """Unknowns at the border of the box that this one goes along with; itself if it stands there.
    """


def judge(
    sought: Sequence[Unknown],
    u: FloatArray,
    information: Information,
    cost: float,
    drift: FloatArray | None = None,
) -> tuple[tuple[Judgement, ...], tuple[Direction, ...]]:
    """Judge each unknown by the information about it.

    Null directions are taken out before the rest is inverted; what little they move an unknown
    within the box is added to its deviation. The rest is the greater of what the noise allows and
    of how much the answer moves when one segment is left out (jackknife), which feels a wrong model
    as well; and beside it how far the answer hangs on what was not reported. An unknown at the
    border of the box is held back: how far the others would move if the box let go is added to
    their deviations, and those that go along with it are weak.

    Args:
        sought: The unknowns.
        u: Where they ended, in units of their scales, shape ``(n,)``.
        information: What the data tell there, in the same units.
        cost: Mean squared weighted residual; beyond 1 the noise was assumed too small, or the
            model is wrong, and all deviations grow with its root.
        drift: Changes of half the gradient in other readings of the recording, shape ``(m, n)``.

    Returns:
        One judgement for each unknown, and the directions that are null or weak, worst first.
    """
    values, vectors = np.linalg.eigh(information.fisher / max(cost, 1.0))
    stds = np.where(values > 0.0, 1.0 / np.sqrt(np.maximum(values, 1e-300)), np.inf)
    told = stds <= _NULL
    reach = np.array([_reach(sought, vectors[:, k]) for k in range(u.size)])
    variance = (vectors[:, told] ** 2) @ stds[told] ** 2
    within = np.maximum(np.sqrt(variance), jackknife(information, vectors[:, told]))
    unseen = _moved_by(information, vectors[:, told], drift)
    beyond = (vectors[:, ~told] ** 2) @ np.minimum(stds, reach)[~told] ** 2
    held, freed = _held_back(sought, u, information, vectors[:, told])
    std = np.sqrt(within**2 + unseen**2 + beyond + freed**2)
    held |= (freed > _PULLED * std)[:, None] & held.any(axis=0)
    directions = tuple(
        _direction(sought, vectors[:, k], float(stds[k]), float(reach[k]))
        for k in np.argsort(-stds)
        if stds[k] > _WEAK
    )
    count = information.fisher_by_segment.shape[0]
    judged = [
        _judgement(sought, k, held[k], float(std[k]), float(unseen[k]), directions, count)
        for k in range(u.size)
    ]
    return tuple(judged), directions


def unjudged(sought: Sequence[Unknown]) -> tuple[Judgement, ...]:
    """Return the judgement of a search that did not end at a minimum: there are no deviations."""
    judgement = Judgement(
        "weak", math.inf, "the search has not ended at a minimum: nothing is known of its error"
    )
    return tuple(judgement for _ in sought)


def _reach(sought: Sequence[Unknown], vector: FloatArray) -> float:
    """Return how far a direction can be followed from the middle of the box."""
    half = np.array([0.5 * (unknown.high - unknown.low) for unknown in sought])
    return float(np.min(half / np.maximum(np.abs(vector), 1e-12)))


def _held_back(
    sought: Sequence[Unknown], u: FloatArray, information: Information, told: FloatArray
) -> tuple[BoolArray, FloatArray]:
    """Return what the box holds back, and how far each unknown would move if it let go.

    Args:
        sought: The unknowns.
        u: Where they ended, shape ``(n,)``.
        information: What the data tell there.
        told: Orthonormal directions in which there is an answer, shape ``(n, k)``.

    Returns:
        Whether unknown ``i`` goes along with ``j``, which stands at the border, shape ``(n, n)``;
        and the distances, shape ``(n,)``.
    """
    border = at_border(sought, u)
    held = np.zeros((u.size, u.size), dtype=np.bool_)
    if not border or told.shape[1] == 0:
        return held, np.zeros(u.size)
    covariance = told @ np.linalg.solve(told.T @ information.fisher @ told, told.T)
    spread = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    for k in border:
        held[:, k] = np.abs(covariance[:, k]) > _CORRELATED * spread * spread[k]
        held[k, k] = True
    return held, np.abs(covariance @ information.gradient)


def _moved_by(information: Information, told: FloatArray, drift: FloatArray | None) -> FloatArray:
    """Return how far other readings of the recording move the answer at most, shape ``(n,)``."""
    if drift is None or told.shape[1] == 0:
        return np.zeros(told.shape[0])
    if not np.isfinite(drift).all():
        return np.full(told.shape[0], np.inf)
    moved = told @ np.linalg.solve(told.T @ information.fisher @ told, told.T @ drift.T)
    return np.asarray(np.abs(moved).max(axis=1), dtype=np.float64)


def jackknife(information: Information, told: FloatArray) -> FloatArray:
    """Return the standard deviations by leaving out one segment at a time, shape ``(n,)``.

    Args:
        information: Near the best point.
        told: Orthonormal directions in which there is an answer, shape ``(n, k)``.

    Returns:
        Zeros where there is but one segment. Few segments give a deviation that is itself
        uncertain; as with Student's distribution it is raised so that twice of it holds 95 %.
    """
    count = information.gradient_by_segment.shape[0]
    moved = np.zeros((count, told.shape[0]))
    for s in range(count if count > 1 else 0):
        rest = told.T @ (information.fisher - information.fisher_by_segment[s]) @ told
        pull = told.T @ (information.gradient - information.gradient_by_segment[s])
        moved[s] = -told @ np.linalg.lstsq(rest, pull, rcond=None)[0]
    spread = np.sum((moved - moved.mean(axis=0)) ** 2, axis=0)
    few = 1.0 + 1.5 / max(count - 1, 1)
    return np.asarray(few * np.sqrt((count - 1) / count * spread), dtype=np.float64)


def _judgement(
    sought: Sequence[Unknown],
    place: int,
    held: BoolArray,
    std: float,
    unseen: float,
    directions: Sequence[Direction],
    segments: int,
) -> Judgement:
    mine = [direction for direction in directions if place in direction.members]
    null = [direction for direction in mine if direction.is_null]
    unknown, held_by = sought[place], tuple(np.flatnonzero(held).tolist())
    if null:
        return Judgement("not identifiable", math.inf, null[0].message, held_by)
    if place in held_by:
        reason = "stopped at the border of the box: widen the box, or hold it fixed"
        return Judgement("weak", std, reason, held_by)
    said = _deviation(unknown, std)
    if held_by:
        names = listed([lower_title(sought[k].title) for k in held_by])
        stand = "stands" if len(held_by) == 1 else "stand"
        reason = f"{said}; goes along with {names}, which {stand} at the border of the box"
        return Judgement("weak", std, reason, held_by)
    if std > _WEAK:
        if unseen > 0.7 * std:
            return Judgement(
                "weak", std, f"{said}; the actuators were reported too seldom to tell it better"
            )
        partners = [d.message for d in mine if len(d.members) > 1]
        return Judgement("weak", std, said + (f"; {partners[0]}" if partners else ""))
    if segments < FEWEST_SEGMENTS:
        return Judgement("weak", std, f"{said}, if {segments} segments can be trusted")
    return Judgement("identified", std, said)


def _deviation(unknown: Unknown, std: float) -> str:
    """Return a standard deviation as it is read: of a parameter as a part of its value."""
    if not math.isfinite(std):
        return "no bound"
    if unknown.nominal != 0.0:
        return f"±{std * 100:.{0 if std > _WEAK else 1}f} %"
    return f"±{std * unknown.scale * 1e3:.2g} {'g' if unknown.unit == 'kg' else 'm' + unknown.unit}"


def _direction(
    sought: Sequence[Unknown], vector: FloatArray, std: float, reach: float
) -> Direction:
    """Name a direction by what can be moved along it without a trace.

    An unknown takes part if the direction alone makes it weak.
    """
    order = np.argsort(-np.abs(vector))
    apart = min(std, reach)
    members = tuple(int(k) for k in order if abs(vector[k]) * apart > _WEAK) or (int(order[0]),)
    if len(members) == 2:
        members = (min(members), max(members))
    # seen in the logarithm of the magnitudes, products and ratios are sums and differences
    grows = [vector[k] * math.copysign(1.0, sought[k].nominal) > 0.0 for k in members]
    titles = [lower_title(sought[k].title) for k in members]
    return Direction(std, members, _message(titles, grows, std))


def _message(titles: Sequence[str], grows: Sequence[bool], std: float) -> str:
    if std > _NULL:
        if len(titles) == 1:
            return f"the {titles[0]} leaves no trace in the data"
        if len(titles) == 2:
            joint = ("ratio", "/") if grows[0] == grows[1] else ("product", "x")
            return f"only the {joint[0]} {titles[0]} {joint[1]} {titles[1]} enters"
        return f"only ratios of {listed(titles)} enter: measure one of them and hold it fixed"
    if len(titles) == 1:
        return f"the {titles[0]} is weak: ±{std * 100:.0f} %"
    return (
        f"{listed(titles)} can change together with little trace (±{std * 100:.0f} %): measure"
        " one of them and hold it fixed"
    )


def lower_title(title: str) -> str:
    """Return a title for the middle of a sentence: "Drag, tail" becomes "drag (tail)"."""
    head, comma, rest = title.lower().partition(", ")
    return f"{head} ({rest})" if comma else head


def listed(titles: Sequence[str]) -> str:
    """Return titles as a sentence lists them, the first few by name."""
    named = list(titles[:_MOST_NAMED])
    if len(named) == 1:
        return named[0]
    if len(titles) > len(named):
        return ", ".join(named) + f" and {len(titles) - len(named)} more"
    return ", ".join(named[:-1]) + f" and {named[-1]}"
