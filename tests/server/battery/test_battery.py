"""What robots draw, learned by the station of what they say, and what plans make of it."""

import shutil
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from autonomy.estimation.energy_use import Use
from autonomy.planner.config import EnergyConfig
from autonomy.planner.leg import primitive
from autonomy.planner.plan import Leg, PrimitiveKind
from db.query.measured.battery import BatteryReading
from robot_link.messages import RobotMode
from server.access.role import Role
from server.battery import battery_use as module
from server.battery.flown import FlownPlan, hours_of_legs
from server.battery.interval import IntervalCutter
from server.plan.battery import WayHome, battery_of_legs, battery_violations
from tests.server.conftest import GRACE, MINI, api_client, open_station, until
from tests.server.fake_link import state_report
from tests.server.plan.test_plan_dry_run import laid_out
from tests.server.survey.test_plan_choice import plan_in
from tests.server.target.test_tracking_account import by_model

NOW = datetime(2026, 6, 1, 12, tzinfo=UTC)
CAPACITY_WH = 48.0
TRUE_W = {
    RobotMode.SURFACED: 2.6,
    RobotMode.GLIDING: 4.5,
    RobotMode.SWIMMING: 5.2,
}


@pytest.fixture(autouse=True)
def _short_rests(monkeypatch):
    monkeypatch.setattr(module, "_REST_S", 0.05)


def life(rng: np.random.Generator, dives: int, begin: datetime, step: float = 1e-4, true_w=TRUE_W):
    """Yield what a robot says each ten seconds that glides, swims and lies afloat in turns."""
    fraction, at = 0.95, begin
    for _ in range(dives):
        for mode, mean_s in (
            (RobotMode.SURFACED, 200.0),
            (RobotMode.GLIDING, 900.0),
            (RobotMode.SWIMMING, 300.0),
        ):
            for _ in range(int(rng.uniform(0.5, 1.5) * mean_s / 10.0)):
                yield BatteryReading(at, mode, round(fraction / step) * step)
                watts = true_w[mode] * (1.0 + 0.05 * rng.standard_normal())
                fraction -= watts * 10.0 / 3600.0 / CAPACITY_WH
                at += timedelta(seconds=10.0)


def no_plan(start, end):
    del start, end


def cut(words, flown=no_plan):
    cutter = IntervalCutter()
    return [one for one in (cutter.take(word, flown) for word in words) if one]


@pytest.mark.parametrize("step", [1e-4, 1.0 / 255.0])
def test_intervals_hold_what_was_drawn_over_them(step):
    words = list(life(np.random.default_rng(1), 30, NOW, step))
    found = cut(words)
    assert len(found) >= (20 if step == 1e-4 else 5)
    powers = np.array([2.6, 4.5, 0.0, 0.0, 5.2])
    for one in found:
        took_wh = one.fraction * CAPACITY_WH
        assert abs(took_wh - one.hours @ powers) < 0.05 * took_wh + 4.0 * one.reading_std * 48.0
    assert found[0].reading_std == pytest.approx(step / np.sqrt(6.0))


def test_rate_is_held_in_nine_of_ten_lives_with_hidden_powers():
    """Powers are drawn about the model's by 30 %, charges are read by radio or by satellite."""
    held, lives = 0, 200
    for number in range(lives):
        rng = np.random.default_rng([8, number])
        use = by_model("miniglider", None).use
        model_w = [use.prior_w[one] for one in (Use.AFLOAT, Use.GLIDE, Use.SWIM)]
        true_w = dict(zip(TRUE_W, np.array(model_w) * rng.lognormal(0.0, 0.3), strict=True))
        step = 1e-4 if number % 2 else 1.0 / 255.0
        for one in cut(life(rng, 15, NOW, step, true_w)):
            std = one.reading_std * CAPACITY_WH
            use = use.taken(one.hours, one.fraction * CAPACITY_WH, std)
        hours = np.array([0.5, 2.0, 0.0, 0.0, 0.7])
        truth = float(np.array([*true_w.values()]) @ hours[[Use.AFLOAT, Use.GLIDE, Use.SWIM]])
        said = use.energy(hours, pieces=1e9)
        held += said.low_wh <= truth <= said.high_wh
    assert held / lives >= 0.85  # more than 95 % may: these lives scatter less than is believed


def test_charge_that_rises_tells_nothing():
    words = list(life(np.random.default_rng(2), 3, NOW))
    charged = [
        BatteryReading(one.measured_at + timedelta(hours=3), one.mode, one.fraction)
        for one in life(np.random.default_rng(3), 3, NOW)
    ]
    for one in cut([*words, *charged]):
        assert one.ended_at <= words[-1].measured_at or one.started_at >= charged[0].measured_at


def test_silence_is_told_by_the_plan_flown_then_or_by_nothing():
    legs = (120.0, 600.0)
    plan = FlownPlan(
        NOW,
        NOW + timedelta(seconds=760.0),
        (Use.DIVE, Use.GLIDE),
        np.array([20.0, 140.0]),
        np.array([140.0, 740.0]),
    )
    before = BatteryReading(NOW, RobotMode.SURFACED, 0.9)
    after = BatteryReading(NOW + timedelta(seconds=760.0), RobotMode.SURFACED, 0.89)
    (one,) = cut([before, after], plan.hours) or cut([before, after, *_idle(after)], plan.hours)
    assert one.hours[Use.DIVE] * 3600.0 == pytest.approx(legs[0])
    assert one.hours[Use.GLIDE] * 3600.0 == pytest.approx(legs[1])
    dived = BatteryReading(NOW + timedelta(seconds=760.0), RobotMode.GLIDING, 0.89)
    assert cut([before, dived, *_idle(dived)])[0].started_at >= dived.measured_at


def _idle(last: BatteryReading):
    return [
        BatteryReading(
            last.measured_at + timedelta(seconds=50.0 * k),
            RobotMode.IDLE,
            last.fraction - 1e-4 * k,
        )
        for k in range(1, 100)
    ]


def say(world, words, robot=MINI):
    for word in words:
        world.tell(
            state_report(
                robot,
                (1.2, 0.6, 0.0),
                at=word.measured_at,
                mode=word.mode,
                battery_fraction=word.fraction,
            )
        )


async def test_station_learns_what_a_robot_draws_and_knows_it_after_a_restart(
    tmp_path, world, prepared_database
):
    shutil.copy(prepared_database, tmp_path)
    words = list(life(np.random.default_rng(4), 12, datetime.now(UTC) - timedelta(hours=6)))
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:
        first = (await client.get("/api/robots/mini-1/battery")).json()
        assert not first["is_learned"]
        assert first["text"].startswith("By the vehicle's model")
        assert first["recover_by"] is None
        say(world, words)

        async def learned():
            found = (await client.get("/api/robots/mini-1/battery")).json()
            return found if found["flights"] == len(cut(words)) else None

        found = await until(learned)
        powers = {one["use"]: one for one in found["uses"]}
        for use, watts in (("glide", 4.5), ("swim", 5.2)):
            told = powers[use]["power_w"]
            assert told["low"] < told["mean"] < told["high"]
            assert told["mean"] == pytest.approx(watts, rel=0.15)
        assert powers["spiral"]["learned_h"] == 0.0
        assert "Not flown yet" in found["text"]
        due = found["recover_by"]
        rate_w = (2.6 * 200 + 4.5 * 900 + 5.2 * 300) / 1400.0
        assert due["rate_w"]["mean"] == pytest.approx(rate_w, rel=0.1)
        free_h = (found["left"] - 0.1) * CAPACITY_WH / rate_w
        at = [datetime.fromisoformat(due[key]) for key in ("earliest", "at", "latest")]
        hours = [(one - words[-1].measured_at).total_seconds() / 3600.0 for one in at]
        assert hours[0] < hours[1] < hours[2]
        assert hours[1] == pytest.approx(free_h, rel=0.15)
    async with open_station(tmp_path, world) as station, api_client(station, Role.ADMIN) as client:

        async def known_again():
            again = (await client.get("/api/robots/mini-1/battery")).json()
            return again if again["flights"] == found["flights"] else None

        again = await until(known_again)
        assert again["uses"] == found["uses"]


async def test_plan_with_legs_that_outlasts_the_battery_is_not_sent(client, world):
    world.tell(state_report(MINI, (1.2, 0.6, 0.0), battery_fraction=0.5))
    fits = await plan_in(client, await laid_out(client), "draft")
    battery = fits["account"]["battery"]
    assert battery["used_low_wh"] < battery["used_wh"] < battery["used_high_wh"]
    assert battery["used"] == pytest.approx(battery["used_wh"] / CAPACITY_WH)
    assert fits["violations"] == []
    world.tell(
        state_report(
            MINI, (1.2, 0.6, 0.0), at=datetime.now(UTC) + timedelta(seconds=1), battery_fraction=0.1
        )
    )

    async def refused():
        found = (await client.post(f"/api/plans/{fits['id']}/check")).json()["violations"]
        return [one for one in found if one["field"] == "battery"]

    (one,) = await until(refused)
    assert "mini-1 has 10% left and must keep 10%" in one["message"]
    assert "Wh too much" in one["message"]
    short = await plan_in(client, await laid_out(client), "draft")
    assert [one["field"] for one in short["violations"]] == ["battery"]
    answer = await client.post(f"/api/plans/{short['id']}/upload")
    assert answer.status_code == 409


async def test_reserve_is_a_setting_of_each_robot(client):
    answer = await client.patch(
        "/api/config/battery", params={"robot": MINI}, json={"reserve": 0.3}
    )
    assert answer.status_code == 200
    assert (await client.get("/api/robots/mini-1/battery")).json()["reserve"] == 0.3
    assert (await client.get(f"/api/robots/{GRACE}/battery")).json()["reserve"] == 0.1
    wrong = await client.patch("/api/config/battery", json={"reserve": 0.01})
    assert wrong.status_code == 422


async def test_battery_of_nobody_is_not_found(client):
    assert (await client.get("/api/robots/nobody-1/battery")).status_code == 404


def test_way_home_counts():
    mini = by_model("miniglider", 0.2)
    leg = Leg(PrimitiveKind.GLIDE, (0.0, 0.0, 0.0), (0.0, 1.0, 1.0), 0.05, 1200.0, 1.5)
    near = battery_of_legs(mini, [leg], 1300.0, WayHome(), EnergyConfig())
    assert battery_violations(MINI, near) == []
    far = battery_of_legs(mini, [leg], 1300.0, WayHome(400.0, 1.5), EnergyConfig())
    (one,) = battery_violations(MINI, far)
    assert "the way home of 400 m" in one.message


def test_a_stay_at_the_surface_swims_for_the_share_that_its_energy_pays():
    prices = EnergyConfig()
    for share in np.random.default_rng(5).uniform(0.0, 1.0, 20):
        swimming = primitive.energy(PrimitiveKind.SWIM, 3600.0, prices)
        floating = prices.time_factor * 3600.0
        energy = share * swimming + (1.0 - share) * floating
        place = (0.0, 0.0, 0.0)
        leg = Leg(PrimitiveKind.KEEP, place, place, 0.1, 3600.0, energy, radius_m=9.0)
        hours = hours_of_legs([leg], 3700.0, prices)
        assert hours[Use.SWIM] == pytest.approx(share, abs=1e-6)
        assert hours.sum() == pytest.approx(3700.0 / 3600.0)
