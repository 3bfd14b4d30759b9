"""The robot's clock: it drifts under water and is set by one step at the surface."""

from contextlib import AsyncExitStack
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from onboard.clock import ClockModel, OnboardClock, Oscillator
from onboard.node.client import NodeClient
from onboard.node.gps_clock import GpsClockNode, discipline
from robot_link.clock import ScaledClock
from simulator.background import alongside
from tests.robot_link.rig import until
from tests.simulator.flight import EPOCH

SPEED = 50.0


def drifting(rate_std_ppm: float = 200.0, seed: int = 1) -> Oscillator:
    return Oscillator(ClockModel(rate_std_ppm), np.random.default_rng(seed))


def error_s(clock: OnboardClock, oscillator: Oscillator, true_s: float) -> float:
    shown = clock.at(oscillator.count_s(true_s))
    return (shown - EPOCH).total_seconds() - true_s


def test_clock_drifts_with_its_counter_and_one_pulse_sets_it_by_a_step():
    oscillator, clock = drifting(), OnboardClock(EPOCH)
    rate = oscillator.rate_error
    assert abs(rate) > 1e-5
    assert error_s(clock, oscillator, 1000.0) == pytest.approx(1000.0 * rate, abs=2e-6)
    clock.take_pulse(EPOCH + timedelta(seconds=1000.0), oscillator.captured_s(1000.0))
    assert clock.last_step_s == pytest.approx(-1000.0 * rate, abs=1e-5)
    assert error_s(clock, oscillator, 1000.0) == pytest.approx(0.0, abs=1e-5)
    assert error_s(clock, oscillator, 1500.0) == pytest.approx(500.0 * rate, abs=1e-5)


def test_clock_that_is_wrong_by_years_is_right_after_one_pulse():
    oscillator, clock = drifting(), OnboardClock(EPOCH - timedelta(days=4000))
    clock.take_pulse(EPOCH + timedelta(seconds=7), oscillator.captured_s(7.0))
    assert clock.last_step_s == pytest.approx(4000 * 86400.0, abs=1.0)
    assert error_s(clock, oscillator, 8.0) == pytest.approx(0.0, abs=1e-3)


def test_clock_of_a_program_that_joins_a_running_counter_shows_the_time_it_was_given():
    clock = OnboardClock(EPOCH, 3600.0)
    assert clock.at(3600.0) == EPOCH
    assert clock.at(3610.0) == EPOCH + timedelta(seconds=10.0)


def test_same_seed_has_the_same_counter():
    assert drifting(seed=3).captured_s(77.0) == drifting(seed=3).captured_s(77.0)
    assert drifting(seed=3).rate_error != drifting(seed=4).rate_error


async def test_pulses_of_the_node_set_the_clock_at_the_surface_and_end_under_water():
    oscillator, clock = drifting(), OnboardClock(EPOCH)
    truth = ScaledClock(datetime.now(UTC), EPOCH, SPEED)
    is_up = [False]
    node = GpsClockNode(oscillator, truth, EPOCH, lambda: is_up[0])
    async with AsyncExitStack() as stack:
        address = await stack.enter_async_context(node.server.serve())
        client = NodeClient(address)
        for work in (node.run(), client.run(), discipline(clock, client)):
            await stack.enter_async_context(alongside(work, "clock"))
        await client.connected()
        said = await client.ask("fix")
        assert said["has_sky"] is False
        assert clock.last_step_s is None
        is_up[0] = True
        await until(lambda: clock.last_step_s is not None)

        def true_s() -> float:
            return (truth.now() - EPOCH).total_seconds()

        await until(lambda: abs(error_s(clock, oscillator, true_s())) < 0.01)
        is_up[0] = False
        await client.ask("fix")
        steps = clock.last_step_s
        now_s = true_s()
        before_s, after_s = (error_s(clock, oscillator, now_s + more) for more in (0.0, 10_000.0))
        assert after_s - before_s == pytest.approx(oscillator.rate_error * 1e4, rel=0.05)
        assert clock.last_step_s == steps
