"""The rules that a station brings along: one for each channel of the catalogue, and these.

A team changes them and has them back as delivered; see ``server/alarm/rule_book.py``.
"""

from collections.abc import Mapping
from typing import Final

from autonomy.channel import AlarmLevel, Channel
from server.alarm.rule import AlarmRule, RuleLimit, Suppression

CHANNEL: Final = "channel"
"""Begins the key of a channel's rule; the channel's key follows."""
_WORKSHOP: Final[tuple[Suppression, ...]] = ("workshop",)
_SURFACE: Final = "Hold Surface now on its page to bring it up."


def _above(**limits: float) -> tuple[RuleLimit, ...]:
    return tuple(RuleLimit(level=_level(level), high=high) for level, high in limits.items())


def _below(**limits: float) -> tuple[RuleLimit, ...]:
    return tuple(RuleLimit(level=_level(level), low=low) for level, low in limits.items())


def _level(name: str) -> AlarmLevel:
    return RuleLimit.model_validate({"level": name, "high": 0.0}).level


def _state(level: str) -> tuple[RuleLimit, ...]:
    return _above(**{level: 0.5})


RULES: Final = (
    AlarmRule(
        key="battery", title="Battery low", reads="battery",
        limits=_below(warning=20.0, critical=10.0),
        text="{robot} has {detail} of its battery left.",
        action="Recover it, or order it to surface and hold.",
    ),
    AlarmRule(
        key="silence", title="Does not answer", reads="silence", limits=_above(warning=15.0),
        suppressed=_WORKSHOP, text="{robot} does not answer; last heard at {detail}.",
        action="See its links; where it should be now is on the map.",
    ),
    AlarmRule(
        key="port", title="Radio out of order", reads="port", limits=_above(warning=15.0),
        suppressed=_WORKSHOP, text="{detail}", action="See the station's radio and its cable.",
    ),
    AlarmRule(
        key="system id", title="Another under its system id", reads="system_id",
        limits=_state("warning"), text="{robot} is not alone under its system id: {detail}.",
        action="Give one of the two another system id.",
    ),
    AlarmRule(
        key="overdue", title="Overdue at the surface", reads="overdue",
        limits=_above(watch=10.0, critical=40.0), suppressed=_WORKSHOP,
        text="{robot} was to surface at {detail} and did not.",
        action="See where it is predicted to be, and order it to surface by every link.",
    ),
    AlarmRule(
        key="contact", title="Overdue call by satellite", reads="contact",
        limits=_above(watch=10.0, critical=40.0), suppressed=_WORKSHOP,
        text="{robot} was to call at {detail} and did not.",
        action="See the gateway's account, and where it is predicted to be.",
    ),
    AlarmRule(
        key="satellite budget", title="Satellite budget spent", reads="satellite_budget",
        limits=_state("warning"),
        text="The satellite budget of {robot} is spent ({detail} credits); what is on its way "
        "waits until 00:00Z, or for a greater budget.",
        action="Give it a greater budget in Settings, or wait.",
    ),
    AlarmRule(
        key="satellite", title="Satellite fault", reads="satellite_fault",
        limits=_state("warning"), text="Satellite to {robot}: {detail}",
        action="See Log, Satellite.",
    ),
    AlarmRule(
        key="surface order", title="Order to surface not obeyed", reads="surface_order",
        limits=_state("critical"), text="{detail}", action="Order it again, by every link.",
    ),
    AlarmRule(
        key="clock", title="Its clock is wrong", reads="clock", limits=_state("watch"),
        text="{detail}", action="Set its clock before the next dive.",
    ),
    AlarmRule(
        key="plan ended early", title="Plan ended early", reads="plan_ended_early",
        limits=_state("watch"), text="{robot} ended its plan early: {detail}",
        action="See the reason, and plan what is left.",
    ),
    AlarmRule(
        key="adrift", title="Adrift near the shore", reads="adrift", limits=_state("warning"),
        suppressed=_WORKSHOP, text="{detail}", action="Send it a plan, drive it, or fetch it.",
    ),
    AlarmRule(
        key="doubt", title="Estimator inconsistent", reads="doubt",
        limits=_above(watch=1.2999), text="{robot}: {detail}",
        action="Let it surface more often, or plan with the current from dives.",
    ),
    AlarmRule(
        key="target", title="Target lost", reads="target_lost", limits=_state("warning"),
        text="{robot} lost its target; {detail}.", action="Let it circle, or end the pursuit.",
    ),
    AlarmRule(
        key="target speed", title="Target too fast", reads="target_too_fast",
        limits=_state("warning"), text="{robot} follows a target that is too fast for it.",
        action="End the pursuit before it is lost.",
    ),
    AlarmRule(
        key="actuators", title="Actuators", reads="actuators",
        limits=_above(watch=0.5, warning=1.5), text="{robot}: {detail}", action=_SURFACE,
    ),
    AlarmRule(
        key="vehicle", title="What the vehicle says of itself", reads="vehicle",
        limits=_above(watch=0.5, warning=1.5, critical=2.5), text="{robot} {detail}",
    ),
    AlarmRule(
        key="channels", title="Channels announced otherwise", reads="channel_table",
        limits=_state("warning"),
        text="{robot} announces its channels otherwise: {detail}. Values of these are not used.",
        action="Make the catalogue and the robot's own table agree.",
    ),
    AlarmRule(
        key="prediction missed", title="Prediction missed", reads="prediction_miss",
        limits=_above(watch=2.0), suppressed=_WORKSHOP,
        text="{robot} was found {value} from where it was predicted; 1 is the edge of its ellipse.",
        action="Look at the current of its water, and at its compass.",
    ),
    AlarmRule(
        key="plan deviation", title="Off its plan", reads="plan_deviation",
        limits=_above(watch=100.0), hysteresis=20.0, delay_s=60.0, suppressed=_WORKSHOP,
        text="{robot} is {value} off its plan, beyond what its uncertainty explains.",
        action="See the current, and plan anew from where it is.",
    ),
    AlarmRule(
        key="keep-out near", title="Near a keep-out", reads="keep_out_distance",
        limits=_below(watch=10.0, severe=0.0), hysteresis=2.0, delay_s=5.0,
        suppressed=_WORKSHOP,
        text="{robot} may be within {limit} of a keep-out: {value} are left, its uncertainty "
        "counted.",
        action=_SURFACE,
    ),
    AlarmRule(
        key="robots near", title="Two robots near each other", reads="nearest_robot",
        limits=_below(watch=5.0), hysteresis=2.0, delay_s=10.0, clear_after_s=30.0,
        suppressed=_WORKSHOP, text="{robot} may be within {limit} of {detail}.",
        action="Hold one of the two.",
    ),
    AlarmRule(
        key="station disk", title="Station: disk nearly full", reads="disk_free",
        limits=_below(warning=500.0, critical=100.0), hysteresis=50.0,
        text="The station's disk has {value} left.",
        action="Move backups and recordings away from its data folder.",
    ),
    AlarmRule(
        key="station load", title="Station: processors busy", reads="load",
        limits=_above(watch=98.0), hysteresis=5.0, delay_s=600.0, clear_after_s=60.0,
        text="The station's processors have been busy for ten minutes.",
        action="Cancel long jobs, or end other programs.",
    ),
    AlarmRule(
        key="station clock", title="Station: its clock was set", reads="clock_step",
        limits=_above(warning=1.0),
        text="The station's clock jumped by {value}; times from before and after do not fit "
        "together.",
        action="Find out what sets the clock of this machine, and let it be moved slowly.",
    ),
    AlarmRule(
        key="station database", title="Station: database behind", reads="rows_waiting",
        limits=_above(warning=20_000.0, critical=100_000.0), hysteresis=5_000.0, delay_s=10.0,
        text="{value} of measurements wait for the database.",
        action="See the database and the station's disk: rows wait on the disk, and where that is "
        "full in memory, which holds no more than 200,000.",
    ),
)  # fmt: skip


def of_channel(channel: Channel) -> AlarmRule:
    """Return the rule of a channel: the limits that the catalogue has of it."""
    text = "{robot}: {title} is {value}, {side} its limit of {limit}."
    if channel.kind == "switch":
        text = "{robot}: {title} says {value}."
    return AlarmRule(
        key=f"{CHANNEL} {channel.key}",
        title=channel.title,
        kind="catalogue",
        reads=channel.key,
        text=text,
        action=_SURFACE if channel.key == "leak" else "",
    )


def delivered(channels: Mapping[str, Channel]) -> dict[str, AlarmRule]:
    """Return every rule that a station brings along, by key."""
    rules = (*RULES, *(of_channel(channel) for channel in channels.values()))
    return {rule.key: rule for rule in rules}
