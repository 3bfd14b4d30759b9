"""The mission executive, compiled; ``onboard.flight.executive`` is the readable form.

What is left out is said in ``simulator.ahead.ensemble.LEFT_OUT``: holds and resumes, pursuits of
targets, calls by satellite, samples that wait, actuators that fail.
"""

import math

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.compiled import inlined_kernel, inner_kernel
from autonomy.vehicle import kernel as body
from autonomy.vehicle.battery import RESERVE
from onboard.flight import actuator_watch, gentle
from onboard.flight import executive as manner
from onboard.flight.executive import Stage
from onboard.flight.navigation import FIX_HOLDS_S
from onboard.flight.safety import DOUBT_STDS
from robot_link.messages import OnboardPlanState, RobotMode
from simulator.ahead import leg as flown_legs
from simulator.ahead import maneuver as maneuvers
from simulator.ahead import pilot
from simulator.ahead import water as waters
from simulator.ahead.state import Polars, Robot, Setup, State, Water

APPROACH, TURNING, SURFACED = Stage.APPROACH.value, Stage.TURN.value, Stage.SURFACED.value
LEG, NEXT, ABORT, IDLE = (
    Stage.LEG.value, Stage.NEXT.value, Stage.ABORT.value, Stage.IDLE.value
)  # fmt: skip
ON_BOARD, RUNNING = int(OnboardPlanState.ON_BOARD), int(OnboardPlanState.RUNNING)
DONE, FAILED = int(OnboardPlanState.DONE), int(OnboardPlanState.FAILED)
MODE_SURFACED, MODE_IDLE = int(RobotMode.SURFACED), int(RobotMode.IDLE)
NOTHING, TIMED_OUT, BATTERY, LOST = range(4)
"""Why a mission failed; a robot is lost that is not back long after its time is over."""
LOST_S = 1800.0
"""So long."""
FLOAT, SWIM, TURN, RISE, DIVE, KEEP = (
    maneuvers.FLOAT, maneuvers.SWIM, maneuvers.TURN, maneuvers.RISE, maneuvers.DIVE, maneuvers.KEEP
)  # fmt: skip


is_surfaced, distance = maneuvers.is_surfaced, maneuvers.distance
enter_float, enter_rise, enter_turn = (
    maneuvers.enter_float, maneuvers.enter_rise, maneuvers.enter_turn
)  # fmt: skip
enter_swim, is_swim_done, step_swim = (
    maneuvers.enter_swim, maneuvers.is_swim_done, maneuvers.step_swim
)  # fmt: skip
step_float, step_turn, is_turn_done = (
    maneuvers.step_float, maneuvers.step_turn, maneuvers.is_turn_done
)  # fmt: skip
enter_leg, is_leg_done, step_leg = (
    flown_legs.enter_leg, flown_legs.is_leg_done, flown_legs.step_leg
)  # fmt: skip
share_of_leg, turn_course, upstream = (
    flown_legs.share_of_leg, flown_legs.turn_course, flown_legs.upstream
)  # fmt: skip
SURFACE_M = flown_legs.SURFACE_M
begin_step, reset, rise = pilot.begin_step, pilot.reset, pilot.rise
know_mass, forget_mass = pilot.know_mass, pilot.forget_mass
floor_m, is_near_border = waters.floor_m, waters.is_near_border
SWINGS, SWINGS_WITHIN_S = actuator_watch.SWINGS, actuator_watch.SWINGS_WITHIN_S
RP1_MIN, RP1_MAX = body.RP1_MIN, body.RP1_MAX
"""Names that numba resolves once, when it compiles."""

_EXTREME, _WAY, _COUNT, _FIRST = range(4)
"""Index in what is kept of a swing: its extreme, where it goes, how often it turned, and when."""


@inner_kernel
def start(s: State, setup: Setup) -> None:
    """Start the mission on board."""
    s.plan_state, s.stage = RUNNING, NEXT
    s.trim_kg, s.trim_m = setup.trim_kg, setup.trim_m
    s.leg = 0
    s.mission_s = s.kept_s = s.settled_energy = s.leg_work = s.leg_share = 0.0
    enter_float(s, MODE_SURFACED)


@inlined_kernel
def step(
    s: State, setup: Setup, robot: Robot, water: Water, legs: np.ndarray, polars: Polars
) -> None:
    """Write the set points for the next period, before trim."""
    dt = setup.period_s
    begin_step(s)
    _mind_gait(s, setup, robot, legs, polars)
    s.surfaced_s = s.surfaced_s + dt if is_surfaced(s, setup) else 0.0
    if s.plan_state == RUNNING:
        s.mission_s += dt
        s.settled_energy += setup.time_price * dt
        if s.flown >= 0:
            s.leg_share = max(s.leg_share, min(share_of_leg(s, legs), 1.0))
        _keep_limits(s, setup, water, legs)
    _proceed(s, setup, robot, water, legs, polars)
    if s.flown >= 0:
        step_leg(s, setup, robot, legs, polars)
    elif s.maneuver == FLOAT:
        step_float(s, setup, robot, water)
    elif s.maneuver == SWIM:
        step_swim(s, setup, robot)
    elif s.maneuver == TURN:
        step_turn(s, setup, robot, turn_course(s, setup, legs))
    else:
        rise(s, robot)
    if _is_keeping(s):
        rate = s.set_points[3] * s.set_points[4]
        s.settled_energy += setup.swim_price * 2.0 * math.pi**2 * rate * rate * dt


@inner_kernel
def _is_keeping(s: State) -> bool:
    return s.flown >= 0 and s.maneuver == KEEP


@inner_kernel
def _swings(swing: FloatArray, size: float, value: float, time_s: float) -> bool:
    """Take the newest value of a signal; tell whether it turned back so often of late."""
    if swing[_COUNT] < 0.0:
        swing[_EXTREME], swing[_COUNT] = value, 0.0
    moved = value - swing[_EXTREME]
    way = swing[_WAY]
    if way * moved > 0.0 or (way == 0.0 and abs(moved) > size):
        swing[_EXTREME], swing[_WAY] = value, math.copysign(1.0, moved)
    elif way * moved < -size:
        swing[_EXTREME], swing[_WAY] = value, -way
        swing[_FIRST + int(swing[_COUNT]) % SWINGS] = time_s
        swing[_COUNT] += 1.0
    count = int(swing[_COUNT])
    return count >= SWINGS and time_s - swing[_FIRST + count % SWINGS] < SWINGS_WITHIN_S


@inlined_kernel
def watch(s: State, setup: Setup, robot: Robot, sent_mass_m: float) -> None:
    """Notice pitch and sliding mass that chase each other (``ActuatorWatch``)."""
    s.watch_s += setup.period_s
    if math.isnan(s.wanted_pitch_rad):
        return
    travel_m = robot.believed[RP1_MAX] - robot.believed[RP1_MIN]
    off = s.angles_rad[1] - s.wanted_pitch_rad
    by_pitch = _swings(s.pitch_swing, actuator_watch.SWING_RAD, off, s.watch_s)
    size = actuator_watch.MASS_SWING_SHARE * travel_m
    by_mass = _swings(s.mass_swing, size, sent_mass_m, s.watch_s)
    if by_pitch and by_mass:
        s.swung_s = s.watch_s


@inlined_kernel
def _mind_gait(s: State, setup: Setup, robot: Robot, legs: np.ndarray, polars: Polars) -> None:
    """Fly gently while pitch and sliding mass swing."""
    s.minded_s += setup.period_s
    if s.minded_s < manner.MIND_EVERY_S:
        return
    s.minded_s = 0.0
    is_swinging = s.watch_s - s.swung_s < actuator_watch.CALM_S
    is_gentle = s.speed_share < 1.0
    if is_swinging:
        know_mass(s, setup)
    else:
        forget_mass(s)
    if is_swinging == is_gentle:
        return
    if is_swinging:
        pitch_rate = gentle.SLOWEST_SHARE * setup.pitch_rate_rad_s
        s.speed_share, s.gait_pitch_rate_rad_s = gentle.SLOWEST_SHARE, pitch_rate
        s.gait_pitch_growth_rad_s2 = pitch_rate / gentle.SPEEDING_UP_S
        if s.stage == LEG:
            enter_leg(s, setup, robot, legs, polars)
    else:
        s.speed_share = 1.0
        s.gait_pitch_rate_rad_s = s.gait_pitch_growth_rad_s2 = math.inf


@inlined_kernel
def _keep_limits(s: State, setup: Setup, water: Water, legs: np.ndarray) -> None:
    """Come up where a limit is met: for this dive, or for good."""
    if s.stage == ABORT:
        return
    if s.mission_s > setup.timeout_s:
        _abort(s, TIMED_OUT)
    elif s.battery < RESERVE:
        _abort(s, BATTERY)
    elif s.stage == LEG:
        leg = legs[s.leg]
        comes_up = leg.end_ned[2] < SURFACE_M and leg.start_ned[2] >= SURFACE_M
        if not (comes_up or _is_keeping(s)) and _is_in_danger(s, setup, water):
            _end_account(s)
            s.leg = leg.dive_end + 1
            s.dives_cut += 1
            s.stage = NEXT
            enter_rise(s)


@inner_kernel
def _is_in_danger(s: State, setup: Setup, water: Water) -> bool:
    """Tell whether this dive must end: by uncertainty, the floor, or walls and shore."""
    north, east, depth = s.position_ned[0], s.position_ned[1], s.position_ned[2]
    if is_surfaced(s, setup):
        return False
    if s.position_std_m > setup.max_uncertainty_m:
        return True
    if depth > floor_m(water, north, east) - setup.floor_margin_m:
        return True
    kept_m = max(setup.shore_margin_m, DOUBT_STDS * s.position_std_m)
    return is_near_border(s, water, north, east, kept_m)


@inner_kernel
def _abort(s: State, reason: int) -> None:
    _end_account(s)
    s.abort_reason, s.stage = reason, ABORT
    enter_rise(s)


@inner_kernel
def _end_account(s: State) -> None:
    """Settle the part of the leg that was flown."""
    s.settled_energy += s.leg_work * s.leg_share
    s.leg_work = s.leg_share = 0.0


@inner_kernel
def _end_mission(s: State, plan_state: int, reason: int) -> None:
    s.plan_state, s.reason, s.stage = plan_state, reason, IDLE
    enter_float(s, MODE_IDLE)


@inlined_kernel
def _proceed(
    s: State, setup: Setup, robot: Robot, water: Water, legs: np.ndarray, polars: Polars
) -> None:
    """Go on to the next stage if this one is over."""
    if s.stage == NEXT:
        if is_surfaced(s, setup):
            _begin_dive(s, setup, water, legs)
    elif s.stage == APPROACH:
        if is_swim_done(s, setup):
            _turn(s, legs)
    elif s.stage == TURNING:
        if is_turn_done(s):
            s.stage = SURFACED
            enter_float(s, MODE_SURFACED)
    elif s.stage == SURFACED:
        if s.fix_age_s < FIX_HOLDS_S and s.surfaced_s >= setup.surface_min_s:
            _begin_leg(s, setup, robot, legs, polars)
    elif s.stage == LEG:
        if is_leg_done(s, setup, robot, legs):
            _end_leg(s, setup, robot, water, legs, polars)
    elif s.stage == ABORT:
        if is_surfaced(s, setup):
            _end_mission(s, FAILED, s.abort_reason)
        elif s.mission_s > setup.timeout_s + LOST_S:
            _end_mission(s, FAILED, LOST)


@inner_kernel
def _begin_dive(s: State, setup: Setup, water: Water, legs: np.ndarray) -> None:
    """Prepare the dive that the next leg begins, or end the mission."""
    if s.leg >= legs.shape[0]:
        _end_mission(s, DONE, NOTHING)
        return
    north, east = _start_of_dive(s, setup, water, legs)
    if distance(s, north, east) > setup.start_tolerance_m:
        s.stage = APPROACH
        enter_swim(s, setup, north, east, 0.0)
    else:
        _turn(s, legs)


@inner_kernel
def _start_of_dive(s: State, setup: Setup, water: Water, legs: np.ndarray) -> tuple[float, float]:
    """Return where to prepare the next dive: as far upstream as the water then carries it."""
    leg, domain = legs[s.leg], water.domain
    if leg.kind == KEEP:
        return leg.end_ned[0], leg.end_ned[1]
    north, east = leg.start_ned[0], leg.start_ned[1]
    speed = math.hypot(s.sure_ne_m_s[0], s.sure_ne_m_s[1])
    if not 0.0 < speed < manner.HOLDING_SHARE * setup.swimming_speed_m_s:
        return north, east
    north, east = upstream(s, legs, s.leg, leg.dive_end, north, east, setup.tells_current)
    if leg.kind != SWIM:
        north -= s.sure_ne_m_s[0] * setup.turn_s
        east -= s.sure_ne_m_s[1] * setup.turn_s
    return min(max(north, domain[0]), domain[1]), min(max(east, domain[2]), domain[3])


@inner_kernel
def _turn(s: State, legs: np.ndarray) -> None:
    """Turn towards the next leg that has a heading, if the dive does not begin by swimming."""
    headed = -1
    for k in range(s.leg, legs[s.leg].dive_end + 1):
        if legs[k].kind != DIVE:
            headed = k
            break
    if headed < 0 or legs[s.leg].kind in (SWIM, KEEP):
        s.stage = SURFACED
        enter_float(s, MODE_SURFACED)
    else:
        s.stage = TURNING
        enter_turn(s, headed)


@inner_kernel
def _begin_leg(s: State, setup: Setup, robot: Robot, legs: np.ndarray, polars: Polars) -> None:
    leg = legs[s.leg]
    _end_account(s)
    if leg.kind != KEEP:  # what it swims is charged as it is swum
        s.leg_work = max(0.0, leg.energy - setup.time_price * leg.duration_s)
    reset(s, setup)
    s.stage = LEG
    enter_leg(s, setup, robot, legs, polars)


@inner_kernel
def _end_leg(
    s: State, setup: Setup, robot: Robot, water: Water, legs: np.ndarray, polars: Polars
) -> None:
    s.leg_share = 1.0
    _end_account(s)
    is_last_of_dive = s.leg == legs[s.leg].dive_end
    s.leg += 1
    s.kept_s = 0.0
    if not is_last_of_dive:
        _begin_leg(s, setup, robot, legs, polars)
    elif is_surfaced(s, setup):
        _begin_dive(s, setup, water, legs)
    else:
        s.stage = NEXT
        enter_rise(s)
