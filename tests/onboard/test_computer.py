"""What a robot keeps on board: gains of its mission, parameters, memory and log."""

from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest

from autonomy.control.config import BacksteppingConfig, PidConfig
from autonomy.field.config import FIELD_PRESETS
from onboard.log import FileLog
from onboard.memory import (
    FileCommandMemory,
    FilePlanStore,
    FileValues,
    FlownPlan,
    KeyUnreadableError,
    new_log,
    read_key,
)
from onboard.own_parameters import OwnParameters
from onboard.profile import FLIGHT_PROFILES
from onboard.satellite.policy import CallLimits
from onboard.satellite.talk import TalkSettings
from robot_link.messages import CommandNumber, OnboardPlanState
from robot_link.mission import Mission
from robot_link.onboard_settings import OnboardSettings
from robot_link.robot_program import CommandOutcome
from robot_link.service.parameter_table import ParameterRefusal
from simulator.fleet import GRACE_1, MINI_1
from tests.onboard.camera_fixes import fix_at, seen
from tests.simulator.flight import EPOCH, TANK_PLANNER, Life, horizontal, mission, vee

OWN = BacksteppingConfig()


def with_settings(plan: Mission, kind: str, gains) -> Mission:
    settings = OnboardSettings.of(kind, gains, TANK_PLANNER, FIELD_PRESETS["blue_light"])
    return Mission.from_legs(plan.settings, plan.legs, onboard=settings)


def parameters_of(life: Life, *, talk: TalkSettings | None = None, kept=None, saved=None):
    return OwnParameters(
        life.robot.definition.vehicle,
        OWN,
        FLIGHT_PROFILES[life.robot.definition.vehicle.key],
        life.executive,
        talk,
        fix_depth_m=life.robot.program.fixes.surface_depth_m,
        believe_fixes_to=life.robot.program.believe_fixes_to,
        kept=kept or {},
        save=(lambda _values: None) if saved is None else saved.append,
    )


def test_mission_flies_with_the_gains_that_it_brought():
    plan = mission(*vee())
    tracks = []
    for gains in (OWN, OWN.model_copy(update={"k_z": 0.03, "k_1": 0.3})):
        life = Life()
        tracks.append(life.fly(with_settings(plan, "controller.backstepping", gains)))
    own = Life().fly(plan)
    assert tracks[0][:, :4] == pytest.approx(own[:, :4], abs=1e-3)  # gains travel rounded
    count = min(map(len, tracks))
    assert np.abs(tracks[0][:count] - tracks[1][:count]).max() > 1e-3


def test_mission_may_bring_another_law_and_the_next_one_has_the_robots_own_again():
    life = Life()
    plan = mission(*vee())
    pid = PidConfig(z_proportional=0.1, z_derivative=0.2)
    track = life.fly(with_settings(plan, "controller.pid", pid))
    assert life.executive.plan_state is OnboardPlanState.DONE
    assert track[:, 3].max() > 0.3
    life.start(plan)
    assert life.executive.digest_settings is None
    assert life.live_until(lambda: life.executive.plan_state is OnboardPlanState.DONE, 2000.0)
    end = life.estimate.position_ned
    assert horizontal(end, plan.legs[-1].end_ned) < 0.6


def test_parameter_changes_the_flight_at_once_unless_a_mission_brought_its_own():
    life, saved = Life(), []
    table = parameters_of(life, saved=saved).table
    before = life.executive._flight.pilot.controller
    table.set("CTL_K_Z", 0.03)
    assert life.executive._flight.pilot.controller is not before
    assert saved[-1]["CTL_K_Z"] == pytest.approx(0.03)
    life.start(with_settings(mission(*vee()), "controller.backstepping", OWN))
    brought = life.executive._flight.pilot.controller
    table.set("CTL_K_Z", 0.04)
    assert life.executive._flight.pilot.controller is brought


def test_untouched_parameters_leave_a_life_as_it_was():
    plan = mission(*vee())
    plain, declared = Life(seed=5), Life(seed=5)
    parameters_of(declared)
    assert np.array_equal(plain.fly(plan), declared.fly(plan))


def test_depth_to_which_fixes_count_is_a_parameter_that_is_remembered():
    life, saved = Life(seen(None)), []
    program = life.robot.program
    table = parameters_of(life, saved=saved).table
    built = MINI_1.estimator.surface_depth_m
    assert table.read("FIX_DEPTH_M").value == pytest.approx(built)
    assert program.fixes.surface_depth_m == built
    table.set("FIX_DEPTH_M", 1.2)
    again = Life(seen(None))
    parameters_of(again, kept=saved[-1])
    place = (*again.robot.body.plant.position_ned[:2], 0.0)
    for one in (program, again.robot.program):
        one._readings = replace(one._readings, depth_m=0.9)
        one.hear_fix(fix_at(one.now, place))
        assert one.fixes.are_waiting
        assert one._navigator._track._filter.surface_depth_m == pytest.approx(1.2)
    with pytest.raises(ParameterRefusal, match=r"between 0\.01 and 2"):
        table.set("FIX_DEPTH_M", 3.0)


def test_parameters_of_manners_and_satellite_reach_those_that_use_them():
    life = Life()
    talk = TalkSettings(CallLimits(20.0, 1800.0, 200), 205)
    table = parameters_of(life, talk=talk, kept={"SURF_MIN_S": 7.0, "GONE": 1.0}).table
    assert life.executive._flight.profile.surface_min_s == 7.0
    table.set("SAT_PERIOD_S", 300.0)
    table.set("SAT_BYTES", 340)
    table.set("SAT_DAY_MAX", 60)
    assert talk == TalkSettings(CallLimits(20.0, 300.0, 60), 340)
    with pytest.raises(ParameterRefusal, match="between 70 and 340"):
        table.set("SAT_BYTES", 341)


def test_plan_on_board_survives_and_a_damaged_file_counts_as_none(tmp_path):
    store = FilePlanStore(tmp_path / "plan")
    assert store.load() is None
    plan = with_settings(mission(*vee()), "controller.backstepping", OWN)
    store.replace(plan)
    assert FilePlanStore(tmp_path / "plan").load() == plan
    data = (tmp_path / "plan").read_bytes()
    for damaged in (b"", data[:10], b"\xff" + data[1:], bytes(300)):
        (tmp_path / "plan").write_bytes(damaged)
        assert FilePlanStore(tmp_path / "plan").load() is None


def test_commands_that_acted_are_remembered_and_garbage_is_forgotten(tmp_path):
    memory = FileCommandMemory(tmp_path / "commands.json")
    assert memory.load() == []
    acted = [(CommandNumber(7), 1_800_000_000, CommandOutcome.DONE)]
    memory.save(acted)
    assert FileCommandMemory(tmp_path / "commands.json").load() == acted
    for garbage in ("", "[1]", '[[1, 2, "nonsense"]]', "{", "null"):
        (tmp_path / "commands.json").write_text(garbage)
        assert memory.load() == []


def test_values_are_remembered_and_garbage_is_forgotten(tmp_path):
    values = FileValues(tmp_path / "values.json")
    values.save({"A": 1.5})
    assert values.load() == {"A": 1.5}
    for garbage in ("", "[1]", '{"A": "x"}', "null"):
        (tmp_path / "values.json").write_text(garbage)
        assert values.load() == {}


def test_plan_that_was_started_is_remembered_until_it_waits_again(tmp_path):
    plan, file = mission(*vee()).sha256(), tmp_path / "flown"
    assert not FlownPlan(file).is_it(plan)
    FlownPlan(file).note(plan)
    assert FlownPlan(file).is_it(plan)
    FlownPlan(file).note(None)
    assert not FlownPlan(file).is_it(plan)


def test_number_of_a_log_is_never_given_twice_though_the_clock_shows_a_second_again(tmp_path):
    file = tmp_path / "log-number"
    times = [EPOCH, EPOCH, EPOCH - timedelta(days=3), EPOCH + timedelta(days=1)]
    numbers = [new_log(file, at) for at in times]
    assert sorted(set(numbers)) == numbers
    assert numbers[-1] == int(times[-1].timestamp())
    file.write_text("nonsense")
    assert new_log(file, EPOCH) == int(EPOCH.timestamp())


def test_disk_that_refuses_does_not_bring_a_flying_robot_down(tmp_path, caplog):
    folder = tmp_path / "memory"
    folder.mkdir()
    log = FileLog(folder / "log", EPOCH)
    log._events.close()
    log._events = open("/dev/full", "w", buffering=1, encoding="utf-8")  # noqa: SIM115
    for _ in range(3):
        log.note("the satellite rang")
    log.close()
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    FileCommandMemory(blocked / "commands.json").save([])
    FileValues(blocked / "values.json").save({"A": 1.0})
    FlownPlan(blocked / "flown").note(mission(*vee()).sha256())
    with pytest.raises(OSError, match="file"):
        FilePlanStore(blocked / "plan").replace(mission(*vee()))
    assert caplog.text.count("cannot keep") == 3
    assert caplog.text.count("/dev/full ends") == 1


def test_key_that_is_none_names_its_file(tmp_path):
    file = tmp_path / "robot.key"
    with pytest.raises(FileNotFoundError):
        read_key(file)
    for text in ("", "00", "zz" * 32, "00" * 33):
        file.write_text(text)
        with pytest.raises(KeyUnreadableError, match=r"robot\.key"):
            read_key(file)
    file.write_text("0f" * 32 + "\n")
    assert read_key(file) == b"\x0f" * 32


def test_log_has_a_line_for_each_event_and_one_for_each_few_seconds(tmp_path):
    state = Life().robot.program.state_report()
    log = FileLog(tmp_path, EPOCH)
    for tenths in range(200):
        log.track(replace(state, measured_at=EPOCH + timedelta(seconds=tenths / 10)))
    log.note("the satellite rang")
    log.close()
    track = next(tmp_path.glob("track-*")).read_text().splitlines()
    assert len(track) == 1 + 4
    assert len(track[0].split(",")) == len(track[1].split(","))
    assert (
        next(tmp_path.glob("events-*")).read_text() == "2026-05-01T00:00:19Z the satellite rang\n"
    )


def test_log_keeps_a_bounded_number_of_files(tmp_path):
    for hour in range(20):
        FileLog(tmp_path, EPOCH + timedelta(hours=hour)).close()
    assert len(list(tmp_path.iterdir())) == 16
    assert not list(tmp_path.glob("*20260501T00*"))


def test_usual_lake_robot_begins_in_radio_range_and_the_far_one_well_out_of_it():
    near, far = GRACE_1, GRACE_1.far_away()
    assert near.is_in_range(*near.start_ne_m)
    assert not far.is_in_range(*far.start_ne_m)
    water = GRACE_1.site
    for place in (near.start_ne_m, far.start_ne_m):
        assert water.shoreline.distance_m(*place) < -30.0
        assert water.floor_m(*place) > 10.0
