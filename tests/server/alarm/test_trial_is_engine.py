"""A trial shows what the live engine would have done: rule by rule, on the same values."""

import math
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

from hypothesis import given, settings
from hypothesis import strategies as st

from autonomy.channel import CHANNELS
from autonomy.site import TANK
from db.query.fleet.robots import RobotRecord
from robot_link.messages import RobotId, RobotMode
from robot_link.report import Reading
from server.alarm.engine import Engine
from server.alarm.rule import AlarmRule
from server.alarm.trial_task import Past, PastValue, replay
from server.fleet.status import RobotStatus
from server.fleet.trail import Track
from tests.server.fake_link import state_report

T0 = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
MINI = RobotId("mini-1")
MODES = (RobotMode.GLIDING, RobotMode.SURFACED, RobotMode.IDLE)


@dataclass(frozen=True)
class Moment:
    """What a robot told at once: a state report, a reading, or both."""

    at: datetime
    mode: RobotMode | None
    battery: float
    buoyancy_kg: float
    pressure: float | None


@dataclass
class Board:
    """Keeps stretches in which an alarm stood and nobody set it aside."""

    now: datetime = T0
    stretches: list[list[object]] = field(default_factory=list)
    open: tuple[()] = ()
    _stands: SimpleNamespace | None = None

    def standing(self, *_):
        return self._stands

    def raise_(self, _, text, *, level, **more):
        del more
        stands = self._stands
        if stands is None or stands.state == "suppressed" or stands.level != level:
            self._end()
            self.stretches.append([level, self.now, None, text])
        self._stands = SimpleNamespace(level=level, text=text, state="unacknowledged")

    def clear(self, *_, **more):
        self._end()
        self._stands = None

    def park(self, *_):
        if self._stands.state != "suppressed":
            self._end()
            self._stands.state = "suppressed"

    def _end(self):
        if self.stretches and self.stretches[-1][2] is None:
            self.stretches[-1][2] = self.now


class Looks:
    """Notes when the engine wants to be asked again."""

    due: datetime | None = None

    def wake(self, _): ...

    def set_due(self, _, moment):
        self.due = moment


def live(rule, moments, end):
    """Return the stretches in which the live engine had an alarm stand."""
    record = RobotRecord(MINI, "mini-1", "miniglider", "real", None, (), TANK, T0)
    status = RobotStatus(record, Track(0.01, (0.05, 0.12)))
    fleet = SimpleNamespace(statuses=[status], knows=lambda _: True, status=lambda _: status)
    board, looks = Board(), Looks()
    clock = SimpleNamespace(speed=1.0, now=lambda: board.now)
    engine = Engine(fleet, board, clock, looks)
    engine.set_rules([rule], CHANNELS, frozenset())

    def pass_until(moment, *, is_end=False):
        while looks.due is not None and (looks.due < moment or (is_end and looks.due == moment)):
            board.now = looks.due
            engine.judge(MINI)

    for one in moments:
        pass_until(one.at)
        board.now = one.at
        tell(status, one)
        engine.judge(MINI)
    pass_until(end, is_end=True)
    return board.stretches


def tell(status, one):
    if one.mode is not None:
        told = {"battery_fraction": one.battery, "net_buoyancy_kg": one.buoyancy_kg}
        times = {"measured_at": one.at, "received_at": one.at}
        status.state = state_report(MINI, mode=one.mode, **times, **told)
    if one.pressure is not None:
        name = "internal_pressure"
        status.readings[name] = Reading(MINI, name, one.pressure, one.at, one.at)


def tried(rule, moments, end):
    """Return the same by the trial, of the same values as the station keeps them."""
    states = [one for one in moments if one.mode is not None]
    at = [one.at for one in states]
    readings = [(one.at, one.pressure) for one in moments if one.pressure is not None]
    told = {
        "battery": PastValue(at, [100.0 * one.battery for one in states]),
        "net_buoyancy_kg": PastValue(at, [one.buoyancy_kg for one in states]),
        "internal_pressure": PastValue(*map(list, zip(*readings, strict=True)))
        if readings
        else PastValue([], []),
    }
    modes = PastValue(at, [float(one.mode) for one in states])
    past = Past(
        MINI, rule, CHANNELS, {name: told[name] for name in rule.names},
        modes if rule.modes else PastValue([], []), end,
    )  # fmt: skip
    fired = replay(past, lambda _: None, lambda: False)
    return [[one.level, one.begin, one.end, one.text] for one in fired]


NUMBERS = {
    "battery": st.sampled_from([5.0, 20.0, 20.5, 50.0]),
    "net_buoyancy_kg": st.sampled_from([-0.02, 0.0, 0.01]),
    "internal_pressure": st.sampled_from([1000.0, 1050.0, 1100.0, 1101.0, 1200.0]),
}
SECONDS = st.sampled_from([0.0, 1.0, 7.0, 45.0])


@st.composite
def rules(draw):
    kind = draw(st.sampled_from(["limit", "catalogue", "rate", "absence", "expression"]))
    reads = "internal_pressure"
    if kind == "limit":
        reads = draw(st.sampled_from(sorted(NUMBERS)))
    ends = NUMBERS[reads]
    if kind in ("rate", "absence"):
        ends = st.sampled_from([0.5, 10.0, 60.0])
    elif kind == "expression":
        ends = st.just(0.5)
    levels = draw(st.lists(st.sampled_from(["watch", "warning", "critical"]),
                           min_size=1, max_size=2, unique=True))  # fmt: skip
    sides = ["high"] if kind in ("rate", "absence", "expression") else ["high", "low"]
    limits = [{"level": one, draw(st.sampled_from(sides)): draw(ends)} for one in levels]
    document = {
        "key": "drawn", "title": "Drawn", "kind": kind,
        "reads": "" if kind == "expression" else reads,
        "limits": [] if kind == "catalogue" else limits,
        "hysteresis": draw(st.sampled_from([0.0, 0.5, 60.0])),
        "delay_s": draw(SECONDS), "clear_after_s": draw(SECONDS), "window_s": 10.0,
        "modes": draw(st.sampled_from([[], ["gliding"], ["surfaced", "idle"]])),
        "text": "{title} is {value}, {side} {limit}: {detail}",
    }  # fmt: skip
    if kind == "expression":
        document["expression"] = draw(
            st.sampled_from([
                "internal_pressure > 1050 and net_buoyancy_kg > 0",
                "battery < 20.2 or internal_pressure > 1150",
                "net_buoyancy_kg * 100",
            ])
        )  # fmt: skip
    return AlarmRule.model_validate(document)


@st.composite
def series(draw):
    at, moments = T0, []
    for _ in range(draw(st.integers(1, 25))):
        at += timedelta(seconds=draw(st.sampled_from([1, 3, 8, 30, 90])))
        has_state = draw(st.booleans())
        battery = draw(st.sampled_from([0.05, 0.2, 0.205, 0.5, math.nan]))
        moments.append(
            Moment(
                at=at,
                mode=draw(st.sampled_from(MODES)) if has_state else None,
                battery=battery,
                buoyancy_kg=draw(st.sampled_from([-0.02, 0.0, 0.01, math.nan])),
                pressure=draw(NUMBERS["internal_pressure"])
                if not has_state or draw(st.booleans())
                else None,
            )
        )
    return moments


@settings(max_examples=600, deadline=None)
@given(rule=rules(), moments=series())
def test_a_trial_and_the_live_engine_agree_on_every_rule_and_series(rule, moments):
    end = moments[-1].at + timedelta(minutes=3)
    assert tried(rule, moments, end) == live(rule, moments, end)
