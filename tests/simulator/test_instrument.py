"""What simulated robots measure beside the planned field, how often, and how well."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from autonomy.channel import CHANNELS
from autonomy.site import LAKE
from onboard.node.body import BodyNode
from simulator.fleet import FLEET, GRACE_1, MINI_1
from simulator.instrument import Instrument, Instruments, instrument
from simulator.robot import SimulatedBody
from simulator.settings import SimulatorSettings
from simulator.water_field import WaterField
from tests.simulator.flight import Life, mission, vee

OF_GRACE_3 = {"dissolved_oxygen", "temperature", "par", "blue_green_algae"}
PLACE = (100.0, 200.0, 4.0)


def settings(folder, **changes):
    moment = "2026-11-23T00:00:00Z"
    said = {"link_folder": folder, "wall_anchor": moment, "time_anchor": moment}
    return SimulatorSettings.model_validate({**said, **changes})


def test_robots_carry_what_the_real_ones_do_and_a_ctd_if_asked(tmp_path):
    assert {one.channel for one in GRACE_1.instruments} == OF_GRACE_3
    assert [one.channel for one in MINI_1.instruments] == ["temperature"]
    with_ctd = settings(tmp_path, has_ctd=True)
    for name, more in (("grace-1", {"conductivity", "pressure", "salinity"}), ("mini-1", set())):
        without = {one.channel for one in settings(tmp_path).definition(name).instruments}
        assert {one.channel for one in with_ctd.definition(name).instruments} == without | more
    assert FLEET["grace-7"].instruments == GRACE_1.instruments


def test_measurements_scatter_about_the_truth_as_the_instrument_does():
    field = WaterField(LAKE)
    carried = Instruments(GRACE_1.instruments, field, np.random.default_rng(2))
    measured = [carried.measure(OF_GRACE_3, PLACE) for _ in range(800)]
    for one in GRACE_1.instruments:
        values = np.array([each[one.channel] for each in measured])
        exact = field.truth(one.channel, np.array([PLACE]))[0]
        assert values.mean() == pytest.approx(exact, abs=0.15 * one.noise)
        assert values.std() == pytest.approx(one.noise, rel=0.12)


def test_a_measurement_stays_within_what_can_be():
    wild = Instruments([Instrument("par", 1.0, 1e5)], WaterField(LAKE), np.random.default_rng(1))
    values = [wild.measure(["par"], PLACE)["par"] for _ in range(50)]
    assert all(CHANNELS["par"].fault(value) is None for value in values)


def test_what_is_not_carried_is_not_measured():
    body = SimulatedBody(MINI_1, 0)
    assert set(body.measure(["temperature", "salinity"])) == {"temperature"}


def test_instruments_leave_the_other_randomness_of_a_seed_as_it_was():
    bare = SimulatedBody(replace(MINI_1, instruments=()), 5)
    full = SimulatedBody(MINI_1, 5)
    for _ in range(20):
        full.measure(full.instruments)
        for body in (bare, full):
            body.advance(0.1)
        assert full.measure_field() == bare.measure_field()
        assert full.read() == bare.read()
    assert np.array_equal(full.plant.state, bare.plant.state)


def test_a_water_that_maps_another_channel_is_measured_in_that():
    salty = LAKE.model_copy(update={"variable": "salinity"})
    body = SimulatedBody(replace(GRACE_1, site=salty), 0)
    exact = WaterField(salty).truth("salinity", np.array([body.plant.position_ned]))[0]
    assert body.measure_field() == pytest.approx(exact, abs=0.05)


def test_each_instrument_is_asked_at_its_own_rate_and_where_the_field_is_measured():
    slow = replace(MINI_1, instruments=(instrument("temperature", 2.0), instrument("par", 6.0)))
    life = Life(slow)
    life.fly(mission(*vee(), sample_period_s=2.0))
    notebook = life.notebook
    taken = {(place, at) for _, place, _, at in notebook.samples}
    others = {(place, at) for _, place, _, at in notebook.others["temperature"]}
    assert others == taken, "one place and time: one frame"
    times = [at for _, _, _, at in notebook.others["par"]]
    gaps = [(later - earlier).total_seconds() for earlier, later in pairwise(times)]
    assert len(gaps) > 3
    assert min(gaps) >= 6.0 - 1e-6
    assert np.median(gaps) == pytest.approx(6.0, abs=0.11)


async def test_a_program_elsewhere_hears_of_every_instrument():
    body = SimulatedBody(GRACE_1, 0)
    node = BodyNode(body, lambda: 0.0)
    node.publish()
    told = await node._read({})
    assert told["instruments"] == dict(body.instruments)
    assert set(told["measured"]) == OF_GRACE_3
