"""Thesis Appendix C: orbits under class-K functions, and under functions that are none."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from autonomy.tracking.config import THESIS_TRACKING, BarrierConfig, TrackingConfig
from reproduction.result import Figure, Hue, Mark, Panel, Report, Reproduction, Row, Series
from reproduction.tracking.orbit import Orbit, follow

EPSILON, HEADING_RAD, SPEED_M_S = 0.04, 0.6, 0.1
NEAR_START_M, FAR_START_M = 5.0, 10.0
DURATION_S, LAST_S = 400.0, 100.0
APPROACH_S, EARLY_S = 10.0, 60.0
"""Spans from the start over which observability is compared: still on the way, and afterwards."""
NEAR_M = 1.0
COLUMNS: Mapping[str, tuple[float, Mapping[str, str]]] = MappingProxyType(
    {
        f"det^2, {NEAR_START_M:g} m": (NEAR_START_M, {}),
        f"det^2, {FAR_START_M:g} m": (FAR_START_M, {}),
        "|det|, best effort": (NEAR_START_M, {"shape": "absolute", "fallback": "best_effort"}),
    }
)
"""Distance at the start and settings other than the thesis's; the first is the appendix's."""
_DRAWN_S = 120.0
_DISTANCES_M = (0.1, 6.0)
_STRIDE = 5


@dataclass(frozen=True, slots=True)
class Choice:
    """One function of the barrier: how fast the barrier may fall."""

    title: str
    settings: Mapping[str, Any]
    """Fields of ``BarrierConfig``."""
    hue: Hue
    mark: Mark = Mark.LINE
    is_drawn: bool = True

    @property
    def is_class_k(self) -> bool:
        """Whether the theory of barrier functions covers it."""
        return self.settings.get("alpha") in {"linear", "cubic"}


def _choice(
    title: str, alpha: str, slope: float, hue: Hue, mark: Mark = Mark.LINE, *, is_drawn: bool = True
) -> Choice:
    return Choice(title, MappingProxyType({"alpha": alpha, "slope": slope}), hue, mark, is_drawn)


CHOICES = (
    Choice("none", MappingProxyType({"controller": "nominal"}), Hue.NOMINAL, Mark.DASHED),
    _choice("B", "linear", 1.0, Hue.BARRIER),
    _choice("0.1 B", "linear", 0.1, Hue.BARRIER, is_drawn=False),
    _choice("10 B", "linear", 10.0, Hue.BARRIER, is_drawn=False),
    _choice("B^3", "cubic", 1.0, Hue.CUBIC),
    _choice("0", "zero", 1.0, Hue.ZERO, Mark.DASHED),
    _choice("-B", "negative", 1.0, Hue.NEGATIVE),
    _choice("-0.1 B", "negative", 0.1, Hue.NEGATIVE, is_drawn=False),
    _choice("-0.01 B", "negative", 0.01, Hue.SLIGHTLY_NEGATIVE),
    _choice("sgn sqrt|B|", "root", 1.0, Hue.ROOT),
    _choice("-0.01", "constant", 0.01, Hue.CONSTANT, Mark.DASHED),
)
INDEPENDENT: Mapping[str, tuple[float | None, float | None, float, float | None]] = (
    MappingProxyType(
        {
            "none": (0.27, 20.0, 16.6, 0.0),
            "B": (0.505, 21.0, 296.0, 0.0),
            "0.1 B": (0.505, 21.0, 296.0, None),
            "10 B": (0.505, 21.0, 296.0, None),
            "B^3": (0.579, 22.0, 294.0, None),
            "0": (0.603, 22.0, 294.0, None),
            "-B": (0.728, 33.0, 160.0, 0.446),
            "-0.1 B": (1.18, None, 127.0, 0.364),
            "-0.01 B": (1.22, 23.0, 294.0, 0.0),
            "sgn sqrt|B|": (None, 21.0, 17.0, 0.941),
            "-0.01": (1.54, None, 280.0, 0.0),
        }
    )
)
"""Radius m, arrival s (None: never), observability s, share of the fallback, as another program
worked them out on the same scenario; its last two columns are rounded to what is written."""
AGREES = 0.03
"""Two programs agree within this share: where the fallback acts, a path depends on rounding."""


def reproduce(seed: int, report: Report) -> Reproduction:
    """Follow a target that stays with each function and exact states; nothing is random."""
    del seed
    runs: dict[str, dict[str, Orbit]] = {column: {} for column in COLUMNS}
    for number, choice in enumerate(CHOICES):
        report(number / len(CHOICES), f"orbit with {choice.title}")
        for column, (start_m, settings) in COLUMNS.items():
            runs[column][choice.title] = run(choice, start_m, **settings)
    near, _, product = runs.values()
    return Reproduction(
        name="appendix-c",
        title="Thesis Appendix C: orbits under other class-K functions",
        scenario=_scenario(),
        rows=tuple(
            row
            for choice in CHOICES
            for column, orbits in runs.items()
            for row in _rows(choice.title, column, orbits[choice.title])
        ),
        figure=_figure(near),
        notes=(*_findings(near), *_agreement(near), _product(product)),
    )


def run(choice: Choice, start_m: float, **settings: str) -> Orbit:
    """Follow a target at the origin from ``start_m`` south of it, with the thesis's settings.

    Args:
        choice: The function of the barrier.
        start_m: Distance at the start.
        settings: Other fields of ``BarrierConfig``.
    """
    config = _config({**choice.settings, **settings})
    return follow(config, (-start_m, 0.0, HEADING_RAD, SPEED_M_S), DURATION_S)


def _config(settings: Mapping[str, Any]) -> TrackingConfig:
    barrier = THESIS_TRACKING.barrier.model_dump() | {"epsilon": EPSILON} | dict(settings)
    return THESIS_TRACKING.model_copy(update={"barrier": BarrierConfig.model_validate(barrier)})


def _rows(title: str, column: str, orbit: Orbit) -> list[Row]:
    values = (
        (f"radius, last {LAST_S:g} s", orbit.radius_m(LAST_S), "m"),
        (f"nearer than {NEAR_M:g} m after", orbit.arrival_s(NEAR_M), "s"),
        (f"way to {NEAR_M:g} m, longer than straight by", detour_share(orbit), ""),
        ("inverse condition over time", orbit.observability_s(), "s"),
        (f"same, first {APPROACH_S:g} s", orbit.observability_s(APPROACH_S), "s"),
        (f"same, first {EARLY_S:g} s", orbit.observability_s(EARLY_S), "s"),
        ("share of steps without a solution", orbit.fallback_share, ""),
    )
    return [
        Row(f"{title}: {name}", column, ours, None, unit)
        for name, ours, unit in values
        if ours is not None
    ]


def detour_share(orbit: Orbit) -> float | None:
    """Return by how much the way to ``NEAR_M`` is longer than a straight one; None for no way."""
    arrival = orbit.arrival_s(NEAR_M)
    if arrival is None:
        return None
    way = orbit.state[: round(arrival / orbit.step_s) + 1, :2]
    flown = float(np.hypot(*np.diff(way, axis=0).T).sum())
    return flown / math.dist(way[0], way[-1]) - 1.0


def _findings(near: Mapping[str, Orbit]) -> tuple[str, ...]:
    """Say which of the appendix's sentences these runs show; each verdict is worked out."""
    direct = [detour_share(near[title]) for title in ("B", "B^3")]
    is_direct = all(each is not None and each < 0.1 for each in direct)
    tight, slight = near["B"], near["-0.01 B"]
    negative = [near[title] for title in ("-B", "-0.1 B", "-0.01 B")]
    wider = all(each.radius_m(LAST_S) > tight.radius_m(LAST_S) for each in negative)
    later = all(_arrival(each) > _arrival(tight) for each in negative)
    failing = [
        title for title, each in near.items() if title != "none" and each.fallback_share > 0.01
    ]
    return (
        f"{_verdict(is_direct)}: B and B^3 go almost straight to the target and orbit it then "
        f"(their way to {NEAR_M:g} m is at most {100 * max(each or 0.0 for each in direct):.0f} % "
        "longer than straight).",
        f"{_verdict(wider and later)}: negative slopes make wider orbits that are reached later, "
        "if at all.",
        f"{_verdict(bool(failing))}: the constraint cannot always be met where the state is pushed "
        f"inward; here with {', '.join(failing)}.",
        _earlier(tight, near["-B"]),
        "The curves of Figure C.1, its barrier level and its start are not in the text, so what is "
        f"not confirmed may be the scenario's. The orbit of -0.01 B ({slight.radius_m(LAST_S):.2f} "
        "m) depends on the start.",
    )


def _earlier(tight: Orbit, pushed: Orbit) -> str:
    """Say whether pushing inward observes better early on, and until when."""
    ahead = np.cumsum(pushed.inverse_condition) > np.cumsum(tight.inverse_condition)
    until = tight.step_s * float(np.flatnonzero(ahead).max(initial=-1) + 1)
    near_sums = [each.observability_s(APPROACH_S) for each in (pushed, tight)]
    late_sums = [each.observability_s(EARLY_S) for each in (pushed, tight)]
    if near_sums[0] <= near_sums[1]:
        word = "Not confirmed"
    else:
        word = "Confirmed" if late_sums[0] > late_sums[1] else "Confirmed on the way in only"
    return (
        f"{word}: a negative slope observes better early on. The inverse condition number sums to "
        f"{near_sums[0]:.2f} s for -B and {near_sums[1]:.2f} s for B over the first "
        f"{APPROACH_S:g} s, and to {late_sums[0]:.1f} s and {late_sums[1]:.1f} s over the first "
        f"{EARLY_S:g} s; -B leads for {until:.0f} s."
    )


def _arrival(orbit: Orbit) -> float:
    arrival = orbit.arrival_s(NEAR_M)
    return math.inf if arrival is None else arrival


def _verdict(holds: bool) -> str:
    return "Confirmed" if holds else "Not confirmed"


def _agreement(near: Mapping[str, Orbit]) -> tuple[str, ...]:
    apart = [title for title, orbit in near.items() if not _agrees(orbit, INDEPENDENT[title])]
    share = f"within {100 * AGREES:.0f} % on the same scenario"
    radius = math.sqrt(math.sqrt(EPSILON) / THESIS_TRACKING.motion.turn_rate_max_rad_s)
    others = f" but for {', '.join(apart)}" if apart else ""
    return (
        f"Another program's radius, arrival, observability and fallback agree {share}{others}.",
        "The thesis prints no numbers here. Limited by the turn rate, the orbit's radius is the "
        f"root of sqrt(eps) by the most turn rate: {radius:.4f} m; B reaches "
        f"{near['B'].radius_m(LAST_S):.4f} m.",
    )


def _agrees(orbit: Orbit, figures: tuple[float | None, float | None, float, float | None]) -> bool:
    radius, arrival, observability, share = figures
    ours = orbit.arrival_s(NEAR_M)
    return (
        (radius is None or abs(orbit.radius_m(LAST_S) / radius - 1.0) < AGREES)
        and (ours is None) == (arrival is None)
        and (ours is None or arrival is None or abs(ours - arrival) < 0.5 + AGREES * arrival)
        and abs(orbit.observability_s() / observability - 1.0) < AGREES
        and (share is None or abs(orbit.fallback_share - share) < AGREES)
    )


def _product(product: Mapping[str, Orbit]) -> str:
    away = [title for title, orbit in product.items() if orbit.radius_m(LAST_S) > NEAR_START_M]
    kept = product["B"].radius_m(LAST_S)
    return (
        f"With |det| and best effort, the settings a mission starts with, B orbits at {kept:.3f} m "
        f"as well. {', '.join(away) or 'None'} did not stay within {NEAR_START_M:g} m: functions "
        "that are not class K are for study only."
    )


def _scenario() -> dict[str, object]:
    return {
        "thesis": "Appendix C, Figure C.1 (no numbers are printed)",
        "target": "stays at the origin",
        "start": f"{NEAR_START_M:g} m south (and {FAR_START_M:g} m), heading {HEADING_RAD:g} rad, "
        f"{SPEED_M_S:g} m/s: chosen here",
        "feedback": "exact states",
        "duration_s": DURATION_S,
        "step_s": 0.1,
        "solver": "closed form of the quadratic program, compiled",
        "where the constraint cannot be met": "the nominal command, clipped",
        "random": "nothing; the seed does not matter",
        "functions": {choice.title: dict(choice.settings) for choice in CHOICES},
        "class_k": [choice.title for choice in CHOICES if choice.is_class_k],
        "another program": {
            title: dict(
                zip(("radius_m", "arrival_s", "observability_s", "fallback"), each, strict=True)
            )
            for title, each in INDEPENDENT.items()
        },
        "settings": _config({}).model_dump(mode="json", include={"barrier", "motion"}),
    }


def _figure(near: Mapping[str, Orbit]) -> Figure:
    drawn = [choice for choice in CHOICES if choice.is_drawn]
    covered = [choice for choice in drawn if choice.is_class_k or choice.title in {"none", "0"}]
    others = [choice for choice in drawn if choice not in covered]
    range_lines = tuple(
        _line(choice, near[choice.title].time_s, near[choice.title].range_m) for choice in drawn
    )
    sums = tuple(
        _line(
            choice,
            near[choice.title].time_s,
            np.cumsum(near[choice.title].inverse_condition) * near[choice.title].step_s,
        )
        for choice in drawn
    )
    return Figure(
        (
            _map("class K, zero, and none", covered, near),
            _map("not class K", others, near),
            Panel(
                "distance",
                "time (s)",
                "distance (m)",
                range_lines,
                logarithmic="y",
                y_range=_DISTANCES_M,
            ),
            Panel("observability", "time (s)", "inverse condition, summed (s)", sums),
        ),
        2,
        f"Above: paths of the first {_DRAWN_S:g} s seen from above; the star is the target.",
    )


def _map(title: str, choices: list[Choice], near: Mapping[str, Orbit]) -> Panel:
    lines: list[Series] = []
    for choice in choices:
        orbit = near[choice.title]
        path = orbit.state[orbit.time_s <= _DRAWN_S]
        lines.append(Series(choice.title, path[::2, 1], path[::2, 0], choice.hue, choice.mark))
    target = Series("target", np.zeros(1), np.zeros(1), Hue.TARGET, Mark.FILLED)
    return Panel(title, "east (m)", "north (m)", (*lines, target), is_map=True)


def _line(choice: Choice, time_s: np.ndarray, values: np.ndarray) -> Series:
    return Series(choice.title, time_s[::_STRIDE], values[::_STRIDE], choice.hue, choice.mark)
