"""What the station says of a current, in words."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.current.model import FEWEST, CurrentMap, Observation
from autonomy.current.table import FlowRecord
from autonomy.estimation.prediction import CHI_SQUARED_90
from server.current.record import Verdict
from server.current.told import told_text
from server.current.water_current import JUDGED, WaterCurrent
from server.fleet.current_words import cm_s, flow_text, metres

_WEAK_TIDE_M_S = 0.005
_STEPS = 96
"""Moments of a tide's period that are looked at."""
_LEAST_VERDICTS = 3
_COUNTS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")


def dives_text(found: WaterCurrent) -> str:
    """Say what the map is made of."""
    dives = found.dives
    if not found.config.enabled:
        return "The current of this water is not mapped: the settings say so."
    if not dives:
        return "No dive has told of the current yet."
    robots = sorted({one.robot for one in dives})
    names = robots[0] if len(robots) == 1 else f"{', '.join(robots[:-1])} and {robots[-1]}"
    text = f"From {len(dives)} dive{'s' if len(dives) > 1 else ''} of {names}."
    if len(dives) < FEWEST:
        text += f" It takes {FEWEST} to tell anything."
    return text


def place_text(known: CurrentMap, robot: str, place_ned: Sequence[float], now_s: float) -> str:
    """Say what the current is at a robot."""
    flow = known.flow(np.array([[*place_ned, now_s]]))
    (north, east), cov = flow.mean_ne_m_s[0].tolist(), flow.cov_m2_s2[0]
    std = math.sqrt(max(float(np.trace(cov)) / 2.0, 0.0))
    none = f"none that it could tell; give or take {cm_s(std)} cm/s"
    return f"At {robot} now {flow_text(north, east, std) or none}."


def tide_text(known: CurrentMap, place_ned: Sequence[float], now_s: float) -> str:
    """Say how strong the tide gets and when it is slack next; "" where none was found."""
    used = known.learned or known.config
    periods = [
        3600.0 * period
        for std, period in zip(used.tide_std_m_s, used.tide_periods_h, strict=True)
        if std > 0.0
    ]
    if not periods:
        return ""
    times = now_s + np.linspace(0.0, max(periods), _STEPS)
    points = np.column_stack([np.tile(place_ned, (_STEPS, 1)), times])
    speed: FloatArray = np.hypot(*known.tide(points).T)
    if float(speed.max()) < _WEAK_TIDE_M_S:
        return ""
    half = speed[: _STEPS // 2]
    slack = datetime.fromtimestamp(float(times[int(half.argmin())]), UTC)
    return f"Tide up to {cm_s(float(speed.max()))} cm/s, next slack {slack:%H:%MZ}."


def worth_text(verdicts: Sequence[Verdict]) -> str:
    """Say how far dives ended from what had been said of them before they began."""
    count = len(verdicts)
    by_map = rms([one.error_m for one in verdicts])
    by_last = rms([one.last_error_m for one in verdicts])
    if by_map is None or by_last is None or count < _LEAST_VERDICTS:
        return ""
    return (
        f"The last {_COUNTS[count]} surfacings were {metres(by_map)} from the prediction; by the "
        f"last current they would have been {metres(by_last)}."
    )


@dataclass(frozen=True, slots=True)
class Worth:
    """What each choice of a current to plan in is worth, a sentence or two each."""

    none: str
    typed: str
    map: str


def worth_of(found: WaterCurrent, typed_ne_m_s: tuple[float, float], now_s: float) -> Worth:
    """Say how far the last dives ended from where each choice would have had them end."""
    last = found.dives[-JUDGED:]
    none, typed = _misses(last, (0.0, 0.0)), _misses(last, typed_ne_m_s)
    if none is None or typed is None:
        unknown = "No dive has told yet how the water moves."
        return Worth(unknown, unknown, _map_worth(found, now_s))
    many = "the last dive" if len(last) == 1 else f"the last {_COUNTS[len(last)]} dives"
    rms_word = "" if len(last) == 1 else " (rms)"
    by_none = f"It carried {many} {metres(none)}{rms_word} off."
    by_typed = f"By it {many} would have come up {metres(typed)}{rms_word} off."
    return Worth(by_none, by_typed, _map_worth(found, now_s))


def _misses(dives: Sequence[Observation], current_ne_m_s: tuple[float, float]) -> float | None:
    """Return how far dives ended from where a steady current would have carried them, rms."""
    north_m_s, east_m_s = current_ne_m_s
    return rms(
        [
            math.hypot(
                one.displacement_ne_m[0] - one.duration_s * north_m_s,
                one.displacement_ne_m[1] - one.duration_s * east_m_s,
            )
            for one in dives
        ]
    )


def _map_worth(found: WaterCurrent, now_s: float) -> str:
    """Say what the map is made of, how old that is, and how far its predictions were off."""
    if found.config.enabled and not found.dives and found.known.is_told(now_s):
        return told_words(found, now_s)
    if not found.config.enabled or not found.dives:
        return f"{dives_text(found)} The typed current holds."
    age_s = max(0.0, now_s - found.known.newest_s)
    many = f"{len(found.dives)} dive{'s' if len(found.dives) > 1 else ''}"
    text = f"{many}, the newest {_age(age_s)} ago."
    if not found.is_usable(now_s):
        why = "that is too long ago" if found.has_enough else f"it takes {FEWEST} of them"
        return f"{text} For a plan {why}: until then the typed current holds."
    text += f" One like the newest would come up within {metres(_reach_m(found, now_s))} (9 of 10)"
    error_m = rms([one.error_m for one in found.verdicts])
    if error_m is None or len(found.verdicts) < _LEAST_VERDICTS:
        return f"{text}; too few were predicted to judge that."
    return f"{text}; the last {_COUNTS[len(found.verdicts)]} were {metres(error_m)} (rms) off."


def _reach_m(found: WaterCurrent, now_s: float) -> float:
    """Return how far from its prediction the newest dive would end now in 9 of 10 cases."""
    dive = found.dives[-1]
    noise_m2 = dive.walk_std_m**2 + dive.fix_std_m**2
    times_s = dive.time_s - dive.time_s[0] + now_s
    cov_m2 = found.known.displacement(times_s, dive.position_ned, noise_m2).cov_m2
    return math.sqrt(CHI_SQUARED_90 * max(float(np.trace(cov_m2)) / 2.0, 0.0))


def _age(age_s: float) -> str:
    for unit_s, unit in ((86_400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if age_s >= 2.0 * unit_s:
            return f"{age_s / unit_s:.0f} {unit}"
    return f"{age_s:.0f} s"


def told_words(found: WaterCurrent, now_s: float) -> str:
    """Say who tells of the current besides, and how far the dives bear it out; "" for nobody."""
    if found.told is None:
        return ""
    text = told_text(found.told, datetime.fromtimestamp(now_s, UTC))
    if found.known.told is None:
        return f"{text} Its file is missing."
    return f"{text} The dives let {100.0 * found.known.belief:.0f} % of it be believed."


def tellers(found: WaterCurrent | None, flow: FlowRecord) -> str:
    """Say who tells of a table of a map, with the verb: "8 dives tell"."""
    if found is None or found.told is None or not found.known.is_told(flow.from_s):
        return f"{flow.dives} dives tell"
    source = found.told.source or "an operator"
    return f"{flow.dives} dives and {source} tell" if flow.dives else f"{source} tells"


def left_out_text(left_out: dict[str, str]) -> str:
    """Say whose dives are not counted; "" where all are."""
    return " ".join(
        f"The newest dive of {robot} is left out: {why}." for robot, why in sorted(left_out.items())
    )


def rms(values: Sequence[float]) -> float | None:
    """Return the root mean square, ``None`` of nothing."""
    return math.sqrt(sum(one * one for one in values) / len(values)) if values else None
