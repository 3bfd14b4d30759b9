"""The gain of a suggestion in words: against what, by which measure, from what."""

from datetime import datetime

from server.fleet.current_words import metres
from server.schedule.replan.present import Present
from server.schedule.replan.problem import Judged, SuggestionFound

_TWICE = 1.0
_SEEN = 0.005
"""A gain below it is told as none."""
_SAME = 0.02
"""Part of energy or time that is called the same."""
_SHORT_S = 600.0
"""Shorter times are told in seconds."""
MEASURES = {
    "information_gain": "the part of the map's variance that it takes away",
    "ergodic": "how well its time is spread over where the map is high or uncertain",
    "weighted": "information gain and ergodic measure, added up with the settings' weight",
}
"""By the plan's objective."""
_LEAST = 1e-9


def gain_of(objective: str, keep: Judged, new: Judged) -> float:
    """Return how much more a new plan brings than what is left of the present one, as a part.

    Information is held against information by the variance that it takes away; other objectives by
    their own figure.
    """
    if objective == "information_gain":
        return new.removed / max(keep.removed, _LEAST) - 1.0
    return (new.objective - keep.objective) / max(abs(keep.objective), _LEAST)


def verdict_text(
    present: Present, found: SuggestionFound, gain: float | None, *, least_gain: float, water: str
) -> str:
    """Say what a search came to, in a sentence or two.

    Args:
        present: What is left of the plan that goes on otherwise.
        found: Both, judged.
        gain: Of the new plan; ``None`` where none was found.
        least_gain: Below it a change is not worth while.
        water: What is mapped, such as ``lake``.
    """
    new, keep, name = found.new, found.keep, present.plan.id
    left = f"what is left of {name}"
    if new is None or gain is None:
        return f"Keep {name}: {found.result.message}"
    objective = str(present.plan.config.get("objective"))
    if gain < least_gain:
        better = (
            "nothing better was found"
            if gain <= 0.005
            else f"the new one is only {gain:.0%} better"
        )
        figures = _figures(objective, new, keep, left, who="the best new one")
        return f"Keep {name}: {better} ({figures}). Offered is what is {least_gain:.0%} better."
    if objective == "information_gain":
        more = f"{gain:.0%} more" if gain < _TWICE else f"{1.0 + gain:.1f} times as much"
        head = f"Maps {more} of the {water} for {_price(new, keep)}"
    else:
        head = f"Is {gain:.0%} better for {_price(new, keep)}"
    return f"{head}: {_figures(objective, new, keep, left)}.{_costs(new, keep)}"


def basis_text(
    present: Present,
    found: SuggestionFound,
    *,
    newest_age_s: float | None,
    fix_age_s: float | None,
) -> str:
    """Say what the figures are made of, with ages as they were when the search began."""
    newest = "" if newest_age_s is None else f", the newest {newest_age_s:.0f} s old"
    samples = f"{found.samples} samples{newest}"
    if present.surfacing == "now" and fix_age_s is not None:
        std = "" if present.fix_std_m is None else f" (±{metres(present.fix_std_m)})"
        place = f"from the fix of {fix_age_s:.0f} s before{std}"
    elif present.surfacing == "now":
        place = "from where it lies, without a fix"
    else:
        place = (
            "from where its plan has it come up next, which no fix has confirmed; what it samples "
            "until then counts for both"
        )
    flights = found.keep.flights
    flown = f", the mean of {flights} flights ahead of each" if flights else ", as both are planned"
    return (
        f"Expected by the models, not measured: judged on a map of {samples}{flown}, {place}. Both "
        f"keep the settings of {present.plan.id}."
    )


def deadline_text(until: datetime | None, *, is_late: bool, name: str, surfacing: str) -> str:
    """Say until when a suggestion is in time, or that it is too late."""
    if is_late:
        when = "for this surfacing" if surfacing == "now" else "for the surfacing that it is for"
        return (
            f"Too late {when}; {name} goes on. It can be sent all the same and waits on board for "
            "the next surfacing, but it was judged for another place; ask anew for figures that "
            "hold."
        )
    if until is None:
        return "Nobody can say how long the robot stays; the sooner it is sent the better."
    return f"In time if the robot has it by about {until.strftime('%H:%M:%SZ')}."


def _figures(objective: str, new: Judged, keep: Judged, left: str, who: str = "it") -> str:
    if objective == "information_gain":
        return (
            f"{who} takes away {new.removed:.1%} of the map's variance, {left} {keep.removed:.1%}; "
            f"the most uncertain place keeps a standard deviation of {new.worst_map_std:.3g} "
            f"instead of {keep.worst_map_std:.3g}"
        )
    return f"{who} has an objective of {new.objective:.4g}, {left} of {keep.objective:.4g}"


def _price(new: Judged, keep: Judged) -> str:
    share = new.energy / max(keep.energy, _LEAST) - 1.0
    if abs(share) < _SAME:
        return "the same battery"
    return f"{abs(share):.0%} {'more' if share > 0.0 else 'less'} of the battery"


def _costs(new: Judged, keep: Judged) -> str:
    """Say what else differs, a sentence with a space before it, or nothing."""
    said = [
        f"{after} instead of {before}"
        for after, before, is_other in (
            (
                f"{new.energy:.1f} energy units",
                f"{keep.energy:.1f}",
                _differs(new.energy, keep.energy),
            ),
            (
                *_times(new.duration_s, keep.duration_s),
                _differs(new.duration_s, keep.duration_s),
            ),
            (
                f"a position uncertain by at most {metres(new.worst_position_std_m)}",
                metres(keep.worst_position_std_m),
                _differs(new.worst_position_std_m, keep.worst_position_std_m),
            ),
        )
        if is_other
    ]
    return f" It takes {', '.join(said)}." if said else ""


def _times(new_s: float, keep_s: float) -> tuple[str, str]:
    """Return two times in a unit in which those that differ are told apart, the first with it."""
    if max(new_s, keep_s) < _SHORT_S:
        return f"{new_s:.0f} s", f"{keep_s:.0f}"
    return f"{new_s / 60.0:.1f} min", f"{keep_s / 60.0:.1f}"


def _differs(new: float, keep: float) -> bool:
    return abs(new - keep) > _SAME * max(abs(keep), _LEAST)
