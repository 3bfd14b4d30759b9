"""A plan that comes while another is flown: it waits, and takes its place at a surfacing.

Flown in virtual time by the program that flies real robots, with the desk that its link has.
"""

import random

import pytest

from onboard.link.plan_desk import PlanDesk
from onboard.link.plan_store import MemoryPlanStore, WaitingPlan, resume
from onboard.link.robot_link import CommandOutcome
from onboard.memory import FilePlanStore
from robot_link.clock import SystemClock
from robot_link.messages import SURFACED_BY_COMMAND, CommandKind, OnboardPlanState, RobotMode
from robot_link.mission import Mission
from robot_link.timing import LinkTiming
from tests.onboard.test_restart import SwitchedOff, switched_off_at
from tests.simulator.flight import Life, Notebook, mission, two_dives, vee

RUNNING, DONE, FAILED = OnboardPlanState.RUNNING, OnboardPlanState.DONE, OnboardPlanState.FAILED
FIRST = mission(*two_dives())
SECOND = mission(*vee(heading_rad=0.9))
THIRD = mission(*vee(heading_rad=1.4))
SEEDS = random.Random(7).sample(range(10**6), 8)


class Aboard(Life, Notebook):
    """A robot with its desk; it stands where the link does, and its samples are stored at once."""

    def __init__(self, plans=None, seed: int = 0) -> None:
        Notebook.__init__(self)
        self.desk: PlanDesk | None = None
        Life.__init__(self, seed=seed)
        self.store = MemoryPlanStore() if plans is None else plans
        self.answers = []
        if (found := resume(self.store)) is not None:
            self.program.take_plan(found)
        self.desk = PlanDesk(
            self.store, self.program, SystemClock(), LinkTiming(), self.answers.append
        )
        self.notebook = self

    @property
    def program(self):
        return self.robot.program

    def report_plan(self, state, *, leg=0, energy_used=0.0, reason="") -> None:
        super().report_plan(state, leg=leg, energy_used=energy_used, reason=reason)
        if self.desk is not None:
            self.desk.report(state, leg=leg, energy_used=energy_used, reason=reason)

    def begin_next_plan(self) -> None:
        if self.desk is not None:
            self.desk.begin_next()

    def send(self, plan: Mission, *, start: bool = False) -> str:
        return self.desk.take_mission(plan, start=start, may_wait=True)

    def start(self, plan: Mission) -> CommandOutcome:
        return self.desk.obey(CommandKind.START, plan.sha256()[:12])

    def tell(self, kind: CommandKind) -> CommandOutcome:
        return self.desk.obey(kind, "")

    @property
    def queue(self):
        return self.desk.queue.said(self.desk.plan_hash)

    @property
    def state(self) -> OnboardPlanState:
        return self.executive.plan_state

    def dives(self) -> None:
        assert self.live_until(lambda: self.estimate.depth_m > 0.2, 200.0)

    def surfaces(self) -> None:
        assert self.live_until(lambda: self.program.surfaced_s > 0.0, 300.0)


@pytest.fixture
def flying() -> Aboard:
    """A robot under water, on the first of two dives."""
    robot = Aboard()
    assert robot.send(FIRST, start=True) == ""
    robot.dives()
    return robot


def test_plan_waits_while_another_is_flown_and_both_hashes_are_said(flying):
    assert flying.send(SECOND) == ""
    assert (flying.desk.plan_hash, flying.state) == (FIRST.sha256(), RUNNING)
    assert flying.queue.sha256 == FIRST.sha256()
    assert flying.queue.next_sha256 == SECOND.sha256()
    assert not flying.queue.next_starts


def test_plan_that_may_not_wait_is_refused_as_ever(flying):
    refusal = flying.desk.take_mission(SECOND, start=False)
    assert refusal == "a mission is running: wait for its end, or surface the robot"
    assert flying.queue.next_sha256 is None


def test_started_plan_begins_at_the_next_surfacing_and_not_before(flying):
    flying.send(SECOND)
    assert flying.start(SECOND) is CommandOutcome.DONE
    assert flying.queue.next_starts
    flying.live(3.0)
    assert flying.desk.plan_hash == FIRST.sha256(), "the dive is flown to its end"
    flying.surfaces()
    flying.live(0.2)
    assert (flying.desk.plan_hash, flying.state) == (SECOND.sha256(), RUNNING)
    assert (flying.queue.last_sha256, flying.queue.last_done) == (FIRST.sha256(), False)
    assert flying.queue.next_sha256 is None
    assert flying.store.load() == SECOND
    assert flying.live_until(lambda: flying.state is not RUNNING, 1000.0)
    assert flying.state is DONE
    assert flying.desk.plan_hash == SECOND.sha256()


def test_plan_sent_with_start_at_a_surfacing_begins_there(flying):
    flying.surfaces()
    assert flying.send(SECOND, start=True) == ""
    flying.live(0.3)
    assert (flying.desk.plan_hash, flying.state) == (SECOND.sha256(), RUNNING)


def test_plan_without_start_lets_the_other_be_flown_to_its_end(flying):
    flying.send(SECOND)
    assert flying.live_until(lambda: flying.state is not RUNNING, 2000.0)
    flying.live(5.0)
    assert (flying.desk.plan_hash, flying.state) == (FIRST.sha256(), DONE)
    assert flying.queue.next_sha256 == SECOND.sha256(), "it waits on"
    assert flying.start(SECOND) is CommandOutcome.DONE
    assert (flying.desk.plan_hash, flying.state) == (SECOND.sha256(), RUNNING)
    assert flying.queue.next_sha256 is None


def test_plan_flown_to_its_end_is_said_to_be_done_though_the_next_began(flying):
    flying.surfaces()
    flying.dives()  # the last dive
    flying.send(SECOND, start=True)
    assert flying.live_until(lambda: flying.desk.plan_hash == SECOND.sha256(), 500.0)
    assert (flying.queue.last_sha256, flying.queue.last_done) == (FIRST.sha256(), True)
    assert flying.state is RUNNING


def test_order_to_surface_lets_no_plan_wait_any_more(flying):
    flying.send(SECOND, start=True)
    assert flying.tell(CommandKind.SURFACE) is CommandOutcome.DONE
    assert flying.queue.next_sha256 is None
    assert flying.live_until(lambda: flying.state is not RUNNING, 300.0)
    flying.live(5.0)
    assert (flying.state, flying.executive.reason) == (FAILED, SURFACED_BY_COMMAND)
    assert flying.executive.mode is RobotMode.IDLE
    assert flying.store.load_next() is None


def test_robot_that_comes_up_by_order_takes_no_plan_to_wait(flying):
    flying.tell(CommandKind.SURFACE)
    assert flying.send(SECOND) != ""
    assert flying.queue.next_sha256 is None


def test_plan_does_not_begin_by_itself_after_one_that_was_given_up():
    robot = Aboard()
    robot.send(FIRST, start=True)
    robot.dives()
    brief = mission(*two_dives(), timeout_s=robot.program.time_s + 1.0)
    robot = Aboard()
    robot.send(brief, start=True)
    robot.dives()
    robot.send(SECOND, start=True)
    assert robot.live_until(lambda: robot.state is FAILED, 400.0)
    robot.live(5.0)
    assert robot.state is FAILED
    assert robot.queue.next_sha256 == SECOND.sha256()
    assert not robot.queue.next_starts


def test_held_robot_changes_over_only_when_it_goes_on(flying):
    flying.tell(CommandKind.HOLD)
    flying.surfaces()
    flying.live(5.0)
    flying.send(SECOND, start=True)
    flying.live(20.0)
    assert flying.desk.plan_hash == FIRST.sha256()
    assert flying.executive.mode is RobotMode.HOLDING
    flying.tell(CommandKind.RESUME)
    assert flying.live_until(lambda: flying.desk.plan_hash == SECOND.sha256(), 60.0)


def test_newer_plan_takes_the_place_of_one_that_waits(flying):
    flying.send(SECOND, start=True)
    flying.send(THIRD)
    assert flying.queue.next_sha256 == THIRD.sha256()
    assert not flying.queue.next_starts, "the order to start was the other's"
    assert flying.start(SECOND) is CommandOutcome.WRONG_PLAN


def test_plan_that_leaves_the_water_is_not_begun_and_the_other_is_flown_on(flying):
    outside = mission(*vee(start=(50.0, 50.0)))
    flying.send(outside)
    assert flying.start(outside) is CommandOutcome.NOT_NOW
    flying.send(outside, start=True)
    flying.surfaces()
    flying.live(1.0)
    assert (flying.desk.plan_hash, flying.state) == (FIRST.sha256(), RUNNING)


def test_disk_that_refuses_keeps_nothing_waiting_and_nothing_from_being_purged(flying, monkeypatch):
    def refuse(*_):
        raise OSError("no space")

    flying.send(SECOND, start=True)
    monkeypatch.setattr(flying.store, "replace_next", refuse)
    assert "memory" in flying.send(THIRD)
    assert flying.queue.next_sha256 == SECOND.sha256()
    flying.tell(CommandKind.SURFACE)
    assert flying.live_until(lambda: flying.state is not RUNNING, 300.0)
    flying.live(2.0)
    assert flying.state is FAILED, "what waited does not begin"


@pytest.mark.parametrize("is_done", [False, True])
def test_waiting_plan_survives_a_robot_that_is_cut_off_at_any_write(tmp_path, monkeypatch, is_done):
    for number in range(20):
        path = tmp_path / str(number)
        has_answered = False
        try:
            with switched_off_at(monkeypatch, number, is_done=is_done):
                robot = Aboard(FilePlanStore(path))
                robot.send(FIRST, start=True)
                robot.live(30.0)
                robot.send(SECOND)
                has_answered = True
                robot.start(SECOND)
                robot.surfaces()
                robot.live(0.5)
        except SwitchedOff:
            pass
        else:
            break
        again = Aboard(FilePlanStore(path))
        again.live(5.0)
        assert again.state is not RUNNING, "no plan begins by itself after that"
        assert again.queue.next_sha256 is None
        if has_answered:
            assert again.desk.plan_hash == SECOND.sha256()
            assert again.start(SECOND) is CommandOutcome.DONE
    assert number >= 5, "each of the files was cut"


@pytest.mark.parametrize("seed", SEEDS)
def test_whatever_is_told_no_plan_begins_that_was_not_started(tmp_path, seed):
    """A drawn life: what waits, what is flown and what was ordered never contradict."""
    drawn, path = random.Random(seed), tmp_path / "plan"
    robot, started = Aboard(FilePlanStore(path), seed), set()
    plans = [FIRST, SECOND, THIRD]
    begun = robot.executive.plans_begun
    for _ in range(60):
        plan, deed = drawn.choice(plans), drawn.randrange(10)
        if deed < 3:
            starts = drawn.random() < 0.5
            was_next = robot.queue.next_sha256 == plan.sha256()
            if robot.send(plan, start=starts) == "":
                started = started if was_next else started - {plan.sha256()}
                started |= {plan.sha256()} if starts else set()
        elif deed < 5:
            if robot.start(plan) is CommandOutcome.DONE:
                started |= {plan.sha256()}
        elif deed == 5:
            robot.tell(CommandKind.SURFACE)
            assert robot.queue.next_sha256 is None
            flown = robot.desk.plan_hash
            started &= {flown}
        elif deed == 6:
            robot.tell(drawn.choice([CommandKind.HOLD, CommandKind.RESUME]))
        elif deed == 7 and drawn.random() < 0.3:
            robot, started = Aboard(FilePlanStore(path), drawn.randrange(10**6)), set()
            begun = robot.executive.plans_begun
            assert robot.state is not RUNNING
        robot.live(drawn.uniform(0.1, 30.0))
        if robot.executive.plans_begun != begun:
            begun = robot.executive.plans_begun
            assert robot.desk.plan_hash in started
        queue = robot.queue
        assert queue.next_sha256 is None or queue.next_sha256 != queue.sha256
        held = robot.store.load()
        assert (None if held is None else held.sha256()) == robot.desk.plan_hash
        waits = robot.store.load_next()
        assert (None if waits is None else waits.mission.sha256()) == queue.next_sha256


def test_kept_plan_is_read_back_as_it_was_written(tmp_path):
    store = FilePlanStore(tmp_path / "plan")
    assert not store.has_queued
    store.replace_next(WaitingPlan(SECOND, starts=True))
    assert FilePlanStore(tmp_path / "plan").load_next() == WaitingPlan(SECOND, starts=True)
    store.replace_next(None)
    again = FilePlanStore(tmp_path / "plan")
    assert again.load_next() is None
    assert again.has_queued
    (tmp_path / "plan-next").write_bytes(b"\x01nonsense")
    assert FilePlanStore(tmp_path / "plan").load_next() is None
