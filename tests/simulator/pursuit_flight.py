"""A simulated robot on a mission that follows a target, for tests."""

from autonomy.tracking.config import TRACKING_PRESETS, TrackingConfig
from autonomy.tracking.phase import TargetPhase
from onboard.link.robot_link import CommandOutcome
from robot_link.messages import OnboardPlanState
from robot_link.mission import Mission, MissionSettings
from robot_link.report import TargetReport
from robot_link.target_settings import TargetSettings
from simulator.fleet import RobotDefinition
from tests.simulator.flight import Life, horizontal

TANK, LAKE = TRACKING_PRESETS["miniglider"], TRACKING_PRESETS["grace3"]


def changed(config: TrackingConfig, **groups: dict[str, object]) -> TrackingConfig:
    """Return settings with other values, by group."""
    value = config.model_dump()
    for group, fields in groups.items():
        value[group] |= fields
    return TrackingConfig.model_validate(value)


def order(config: TrackingConfig, number: int = 0) -> Mission:
    """Return a mission; another number is other noise of a virtual target's ranges."""
    settings = MissionSettings(2.0, 50.0, 80000.0 - number, 0.5, 0.5)
    return Mission.for_target(settings, TargetSettings.of(config))


def begin(config: TrackingConfig, seed: int = 0, definition: RobotDefinition | None = None) -> Life:
    life = Life(seed=seed) if definition is None else Life(definition, seed)
    assert life.start(order(config, seed)) is CommandOutcome.DONE
    return life


def report(life: Life) -> TargetReport:
    told = life.robot.program.target_report()
    assert told is not None
    return told


def phase(life: Life) -> TargetPhase:
    return report(life).phase


def error_m(told: TargetReport) -> float:
    assert told.true_ne_m is not None
    return horizontal(told.hypotheses[0].position_ne_m, told.true_ne_m)


def end(life: Life, longest_s: float) -> tuple[OnboardPlanState, str]:
    """Live until the mission is over; return how it ended."""
    assert life.live_until(
        lambda: life.executive.plan_state is not OnboardPlanState.RUNNING, longest_s
    )
    state, _, _, reason = life.notebook.plans[-1]
    return state, reason
