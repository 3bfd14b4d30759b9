"""Which parameters the data can tell, and in plain words which they cannot."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.identification.least_squares import Information
from autonomy.identification.unknown import Unknown

Verdict = Literal["identified", "weak", "not identifiable", "fixed"]

_WEAK = 0.05
"""A standard deviation beyond this part of a parameter's value makes it weak."""
_NULL = 1.0
"""A direction whose standard deviation exceeds the values themselves is not in the data."""
_MEMBER = 0.25
"""A parameter belongs to a direction with more than this part of its largest component."""
_MOST_NAMED = 5


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


def judge(
    sought: Sequence[Unknown], u: FloatArray, information: Information, cost: float
) -> tuple[tuple[Judgement, ...], tuple[Direction, ...]]:
    """Judge each unknown by the information about it.

    Null directions are taken out before the rest is inverted, so that what they do not touch
    keeps an honest standard deviation. That is the greater of what the noise allows and of how much
    the answer moves when one segment is left out (jackknife), which feels a wrong model as well.

    Args:
        sought: The unknowns.
        u: Where they ended, in units of their scales, shape ``(n,)``.
        information: What the data tell there, in the same units.
        cost: Mean squared weighted residual; beyond 1 the noise was assumed too small, or the
            model is wrong, and all deviations grow with its root.

    Returns:
        One judgement for each unknown, and the directions that are null or weak, worst first.
    """
    values, vectors = np.linalg.eigh(information.fisher / max(cost, 1.0))
    stds = np.where(values > 0.0, 1.0 / np.sqrt(np.maximum(values, 1e-300)), np.inf)
    told = stds <= _NULL
    covariance = (vectors[:, told] * stds[told] ** 2) @ vectors[:, told].T
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    std = np.maximum(std, jackknife(information, vectors[:, told]))
    directions = tuple(
        _direction(sought, vectors[:, k], float(stds[k]))
        for k in np.argsort(-stds)
        if stds[k] > _WEAK
    )
    judged = [
        _judgement(sought[k], k, float(u[k]), float(std[k]), directions) for k in range(u.size)
    ]
    return tuple(judged), directions


def jackknife(information: Information, told: FloatArray) -> FloatArray:
    """Return the standard deviations by leaving out one segment at a time, shape ``(n,)``.

    Args:
        information: Near the best point.
        told: Orthonormal directions in which there is an answer, shape ``(n, k)``.

    Returns:
        Zeros where there is but one segment.
    """
    count = information.gradient_by_segment.shape[0]
    moved = np.zeros((count, told.shape[0]))
    for s in range(count if count > 1 else 0):
        rest = told.T @ (information.fisher - information.fisher_by_segment[s]) @ told
        pull = told.T @ (information.gradient - information.gradient_by_segment[s])
        moved[s] = -told @ np.linalg.lstsq(rest, pull, rcond=None)[0]
    spread = np.sum((moved - moved.mean(axis=0)) ** 2, axis=0)
    return np.asarray(np.sqrt((count - 1) / count * spread), dtype=np.float64)


def _judgement(
    unknown: Unknown, place: int, u: float, std: float, directions: Sequence[Direction]
) -> Judgement:
    mine = [direction for direction in directions if place in direction.members]
    null = [direction for direction in mine if direction.is_null]
    if null:
        return Judgement("not identifiable", math.inf, null[0].message)
    if min(u - unknown.low, unknown.high - u) < 1e-9:
        return Judgement(
            "weak", std, "stopped at the border of the box: widen the box, or hold it fixed"
        )
    if std > _WEAK:
        partners = [d.message for d in mine if len(d.members) > 1]
        return Judgement(
            "weak", std, f"+-{std * 100:.0f} %" + (f"; {partners[0]}" if partners else "")
        )
    return Judgement("identified", std, f"+-{std * 100:.1f} %")


def _direction(sought: Sequence[Unknown], vector: FloatArray, std: float) -> Direction:
    """Name a direction by what can be moved along it without a trace."""
    order = np.argsort(-np.abs(vector))
    largest = abs(vector[order[0]])
    members = tuple(int(k) for k in order if abs(vector[k]) > _MEMBER * largest)
    if len(members) == 2:
        members = (min(members), max(members))
    # seen in the logarithm of the magnitudes, products and ratios are sums and differences
    grows = [vector[k] * math.copysign(1.0, sought[k].nominal) > 0.0 for k in members]
    titles = [_lower(sought[k].title) for k in members]
    return Direction(std, members, _message(titles, grows, std))


def _message(titles: Sequence[str], grows: Sequence[bool], std: float) -> str:
    if std > _NULL:
        if len(titles) == 1:
            return f"the {titles[0]} leaves no trace in the data"
        if len(titles) == 2:
            joint = ("ratio", "/") if grows[0] == grows[1] else ("product", "x")
            return f"only the {joint[0]} {titles[0]} {joint[1]} {titles[1]} enters"
        return f"only ratios of {_listed(titles)} enter: measure one of them and hold it fixed"
    if len(titles) == 1:
        return f"the {titles[0]} is weak: +-{std * 100:.0f} %"
    return (
        f"{_listed(titles)} can change together with little trace (+-{std * 100:.0f} %): measure"
        " one of them and hold it fixed"
    )


def _lower(title: str) -> str:
    """Return a title for the middle of a sentence: "Drag, tail" becomes "drag (tail)"."""
    head, comma, rest = title.lower().partition(", ")
    return f"{head} ({rest})" if comma else head


def _listed(titles: Sequence[str]) -> str:
    named = list(titles[:_MOST_NAMED])
    if len(titles) > len(named):
        return ", ".join(named) + f" and {len(titles) - len(named)} more"
    return ", ".join(named[:-1]) + f" and {named[-1]}"
