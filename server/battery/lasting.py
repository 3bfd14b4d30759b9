"""A robot's battery as REST tells it: what draws from it, and when to recover the robot."""

from datetime import datetime, timedelta

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.estimation.energy_use import EnergyEstimate, Use, lasts_h
from server.battery.battery_use import Battery
from server.battery.view import (
    BatteryAfterView,
    RangeView,
    RecoverByView,
    RobotBatteryView,
    UseView,
)

_LEAST_H = 0.2
"""A shorter part of the last day is no rate."""
_FLIGHT_H = 0.25
"""So long is about what scatters by itself."""
_LONGEST_H = 24.0 * 366.0
"""Nobody plans a recovery farther ahead."""


def battery_view(robot: str, battery: Battery, now: datetime) -> RobotBatteryView:
    """Return a robot's battery as it is known now."""
    use, config = battery.use, battery.config
    at = battery.measured_at
    left_wh = None if battery.left is None else battery.left * config.capacity_wh
    return RobotBatteryView(
        robot=robot,
        capacity_wh=config.capacity_wh,
        reserve=config.reserve,
        left=battery.left,
        left_wh=left_wh,
        measured_at=at,
        age_s=None if at is None else max(0.0, (now - at).total_seconds()),
        is_learned=use.rows > 0,
        flights=use.rows,
        outliers=use.outliers,
        scatter=use.scatter,
        uses=[_use_view(battery, one) for one in Use],
        recover_by=recover_by(battery),
        text=source_text(battery),
    )


def recover_by(battery: Battery) -> RecoverByView | None:
    """Return when the charge falls to the reserve at the rate of the last day.

    ``None`` while the robot has not said how much is left.
    """
    if battery.left is None or battery.measured_at is None:
        return None
    hours = float(battery.day_h.sum())
    rate = rate_w(battery)
    left_wh = (battery.left - battery.config.reserve) * battery.config.capacity_wh
    expected, least, most = (min(one, _LONGEST_H) for one in lasts_h(left_wh, rate))
    at = battery.measured_at
    return RecoverByView(
        at=at + timedelta(hours=expected),
        earliest=at + timedelta(hours=least),
        latest=at + timedelta(hours=most),
        rate_w=range_view(rate),
        hours=hours if hours >= _LEAST_H else 0.0,
    )


def battery_after(
    battery: Battery,
    hours: FloatArray,
    dives: int,
    there_h: float,
    home: tuple[float, float] | None,
) -> BatteryAfterView | None:
    """Return what is left after a flight, ``None`` while the robot has not said how much there is.

    Args:
        battery: The robot's.
        hours: Of the flight in each use, shape ``(5,)``, the way there included.
        dives: In how many pieces that scatter by themselves it is parted.
        there_h: Hours of the swim to where it begins.
        home: Distance, m, and hours of the swim home from its end; ``None`` where nobody knows.
    """
    if battery.left is None:
        return None
    use, capacity_wh = battery.use, battery.config.capacity_wh
    start_wh = battery.left * capacity_wh
    takes = use.energy(hours, pieces=dives)
    left_wh = _rest(start_wh, takes)
    at_home = None
    if home is not None:
        way = hours.copy()
        way[Use.SWIM] += home[1]
        at_home = _shares(_rest(start_wh, use.energy(way, pieces=dives + 1)), capacity_wh)
    return BatteryAfterView(
        left=_shares(left_wh, capacity_wh),
        left_wh=left_wh,
        used_wh=range_view(takes),
        there=there_h * use.power(Use.SWIM).mean_wh / capacity_wh,
        home=at_home,
        home_m=None if home is None else home[0],
        reserve=battery.config.reserve,
        capacity_wh=capacity_wh,
        is_learned=use.is_learned(hours),
    )


def _rest(start_wh: float, takes: EnergyEstimate) -> RangeView:
    most_first = (takes.mean_wh, takes.high_wh, takes.low_wh)
    return RangeView(*(max(0.0, start_wh - one) for one in most_first))


def _shares(energy_wh: RangeView, capacity_wh: float) -> RangeView:
    return RangeView(
        *(one / capacity_wh for one in (energy_wh.mean, energy_wh.low, energy_wh.high))
    )


def source_text(battery: Battery) -> str:
    """Say where the figures come from."""
    use = battery.use
    if use.rows == 0:
        return "By the vehicle's model: no flight has told yet what it draws."
    flights = "1 stretch" if use.rows == 1 else f"{use.rows} stretches"
    hours = float(use.learned_h.sum())
    text = f"Learned of {flights} of past flights, {hours:.1f} h."
    strange = [one.name.lower() for one in Use if use.learned_h[one] <= 0.0]
    if strange:
        text += f" Not flown yet, by the vehicle's model: {', '.join(strange)}."
    if use.outliers:
        odd = "one was" if use.outliers == 1 else f"{use.outliers} were"
        text += f" Of these {odd} far off and counted less."
    return text


def range_view(estimate: EnergyEstimate) -> RangeView:
    """Return an estimate as REST tells it."""
    return RangeView(estimate.mean_wh, estimate.low_wh, estimate.high_wh)


def rate_w(battery: Battery) -> EnergyEstimate:
    """Return the mean power of the last day, W; of a robot afloat where nothing tells of it."""
    hours = float(battery.day_h.sum())
    if hours < _LEAST_H:
        return battery.use.power(Use.AFLOAT)
    found = battery.use.energy(battery.day_h, pieces=max(1.0, hours / _FLIGHT_H))
    mean, low, high = (np.array([found.mean_wh, found.low_wh, found.high_wh]) / hours).tolist()
    return EnergyEstimate(mean, low, high)


def _use_view(battery: Battery, use: Use) -> UseView:
    return UseView(
        use=use.name.lower(),
        power_w=range_view(battery.use.power(use)),
        model_w=float(battery.use.prior_w[use]),
        learned_h=float(battery.use.learned_h[use]),
    )
