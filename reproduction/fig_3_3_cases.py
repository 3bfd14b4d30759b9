"""Thesis Figure 3.3: how the pitch wins back horizontal distance, in four cases."""

import math
from dataclasses import dataclass

import numpy as np

from autonomy.control.config import BACKSTEPPING_SIMULATION, BacksteppingConfig
from autonomy.vehicle.config import MINIGLIDER
from autonomy.vehicle.glide import angle_of_attack
from autonomy.whatif.config import StartConfig, StraightConfig, TrialConfig
from autonomy.whatif.run import Trial
from reproduction.contender import CONTENDERS
from reproduction.result import (
    Figure,
    Hue,
    Mark,
    Panel,
    Report,
    Reproduction,
    Row,
    Series,
)
from reproduction.trials import Job, run_jobs

GAP_M = 1.0
GLIDE_ANGLE_RAD = math.radians(45.0)
VERTICAL_SPEED_M_S = 0.03
DURATION_S = 300.0
EARLY_S = 50.0
"""The pitch is compared over the time up to here, while most of the gap is open."""
IN_PLANE_M = 10.0
"""Within this distance the robot steers for the copy's path and not for the copy, so that it stays
in the plane of the figure; the thesis's 5 cm let a robot that is ahead turn round."""
_DEEP_M = 20.0
_DRAWN_S = 150.0
_GAPS_S = (0.0, 30.0, 60.0, 90.0, 120.0, 150.0)
_PROPOSED, _BASELINE, _ = CONTENDERS
_BASELINE_GAINS = BACKSTEPPING_SIMULATION.without_trade()


@dataclass(frozen=True, slots=True)
class Case:
    """One panel of the figure."""

    title: str
    is_ahead: bool
    is_down: bool

    @property
    def pitch_sign(self) -> int:
        """Which way the thesis draws the robot's pitch: 1 steeper than the copy's, -1 shallower."""
        return 1 if self.is_ahead else -1


CASES = (
    Case("ahead, gliding down", is_ahead=True, is_down=True),
    Case("behind, gliding down", is_ahead=False, is_down=True),
    Case("ahead, gliding up", is_ahead=True, is_down=False),
    Case("behind, gliding up", is_ahead=False, is_down=False),
)


@dataclass(frozen=True, slots=True, eq=False)
class CaseRun:
    """One case, tracked three times."""

    case: Case
    proposed: Trial
    baseline: Trial
    turning: Trial
    """The proposed controller with the thesis's 5 cm, free to turn round."""

    def steeper_rad(self) -> float:
        """Return how much steeper than the copy's the pitch is, mean of the early time."""
        trial, early = self.proposed, self.proposed.time_s < EARLY_S
        steepness = np.abs(trial.state[early, 4]) - np.abs(trial.reference[early, 3])
        return float(steepness.mean())


def scenario(case: Case) -> TrialConfig:
    """Return the trial of one case: a robot in the steady glide of its copy, a gap from it."""
    glide = -GLIDE_ANGLE_RAD if case.is_down else GLIDE_ANGLE_RAD
    attack = angle_of_attack(MINIGLIDER.parameters, glide)
    speed = VERTICAL_SPEED_M_S / math.sin(GLIDE_ANGLE_RAD)
    return TrialConfig(
        reference="straight_glide",
        straight=StraightConfig(
            glide_angle_rad=glide,
            vertical_speed_m_s=VERTICAL_SPEED_M_S,
            depth_m=0.0 if case.is_down else _DEEP_M,
        ),
        duration_s=DURATION_S,
        start=StartConfig(
            north_m=GAP_M if case.is_ahead else -GAP_M,
            east_m=0.0,
            pitch_rad=glide + attack,
            forward_speed_m_s=speed * math.cos(attack),
        ),
    )


def case_runs(report: Report) -> list[CaseRun]:
    """Track every case with the proposed law and the baseline in the plane, and free to turn."""
    gains = (_in_plane(BACKSTEPPING_SIMULATION), _in_plane(_BASELINE_GAINS))
    jobs = [
        Job(scenario(case), contender, config, 0)
        for case in CASES
        for contender, config in (
            (_PROPOSED, gains[0]),
            (_BASELINE, gains[1]),
            (_PROPOSED, BACKSTEPPING_SIMULATION),
        )
    ]
    done = iter(run_jobs(jobs, report))
    return [CaseRun(case, next(done), next(done), next(done)) for case in CASES]


def reproduce(seed: int, report: Report) -> Reproduction:
    """Run the four cases; nothing in it is random."""
    del seed
    runs = case_runs(report)
    return Reproduction(
        name="fig-3.3-cases",
        title="Thesis Figure 3.3: the pitch wins back horizontal distance",
        scenario=_scenario(),
        rows=tuple(row for run in runs for row in _rows(run)),
        figure=Figure(
            tuple(_panel(run) for run in runs),
            2,
            f"Paths of the first {_DRAWN_S:g} s in the vertical plane; inset: both pitches, "
            "whole time.",
        ),
        notes=(
            "The thesis draws the direction only; 1 is steeper than the copy, -1 shallower.",
            "Which panel of the thesis is which case is not printed, except that (a) is a robot "
            "that is ahead.",
            f"A robot that is ahead stays in the plane only if it steers for the path within "
            f"{IN_PLANE_M:g} m. With the thesis's 5 cm it turns round towards the copy and passes "
            "it, and the gap grows before it closes.",
        ),
    )


def _in_plane(gains: BacksteppingConfig) -> BacksteppingConfig:
    return gains.model_copy(update={"near_m": IN_PLANE_M})


def _rows(run: CaseRun) -> list[Row]:
    column = run.case.title
    early = run.proposed.time_s < EARLY_S
    steeper = run.steeper_rad()
    wanted = float(np.degrees(run.proposed.reference[0, 3]))
    pitch = float(np.degrees(run.proposed.state[early, 4].mean()))
    distance, held = run.proposed.errors[:, 1], run.baseline.errors[:, 1]
    values: list[tuple[str, float, float | None, str]] = [
        ("pitch of the copy", wanted, None, "deg"),
        (f"pitch, mean of {EARLY_S:g} s", pitch, None, "deg"),
        ("steeper than the copy by", math.degrees(steeper), None, "deg"),
        ("direction", math.copysign(1.0, steeper), float(run.case.pitch_sign), ""),
        ("horizontal error, start", float(distance[0]), None, "m"),
        (f"horizontal error, {DURATION_S:g} s", float(distance[-1]), None, "m"),
        (f"same, baseline (c = 0), {DURATION_S:g} s", float(held[-1]), None, "m"),
        (
            "same, proposed free to turn, greatest",
            float(run.turning.errors[:, 1].max()),
            None,
            "m",
        ),
        (
            f"same, proposed free to turn, {DURATION_S:g} s",
            float(run.turning.errors[-1, 1]),
            None,
            "m",
        ),
    ]
    return [Row(name, column, ours, thesis, unit) for name, ours, thesis, unit in values]


def _scenario() -> dict[str, object]:
    return {
        "thesis": "section 3.2.2, Figure 3.3",
        "vehicle": "Miniglider of Table 3.2, 12 states, end stops and rates of its actuators",
        "copy": "virtual copy in a steady glide of 45 deg, 3 cm/s of depth, down or up",
        "start": f"in the copy's steady glide, {GAP_M:g} m ahead of it or behind, heading along "
        "its path",
        "duration_s": DURATION_S,
        "step_s": TrialConfig().step_s,
        "control": "at every step, exact states",
        "in_plane_m": IN_PLANE_M,
        "random": "nothing; the seed does not matter",
        "gains": _in_plane(BACKSTEPPING_SIMULATION).model_dump(mode="json"),
        "trials": {case.title: scenario(case).model_dump(mode="json") for case in CASES},
    }


def _panel(run: CaseRun) -> Panel:
    """Draw both paths and the closing gap in the vertical plane, and the pitch in an inset."""
    trial = run.proposed
    drawn = trial.time_s <= _DRAWN_S
    robot, copy = trial.state[:, [0, 2]], trial.reference[:, [0, 2]]
    at = [int(np.argmin(np.abs(trial.time_s - moment))) for moment in _GAPS_S]
    gaps = np.stack([robot[at], copy[at], np.full((len(at), 2), np.nan)], axis=1).reshape(-1, 2)
    closed = f"{trial.errors[0, 1]:.2f} m to {trial.errors[-1, 1]:.2f} m in {DURATION_S:g} s"
    return Panel(
        f"{run.case.title}: gap {closed}",
        "north (m)",
        "depth (m)",
        (
            Series("virtual copy", copy[drawn, 0], copy[drawn, 1], Hue.REFERENCE, Mark.DASHED),
            Series("robot", robot[drawn, 0], robot[drawn, 1], Hue.PROPOSED),
            Series(f"gap, every {_GAPS_S[1]:g} s", gaps[:, 0], gaps[:, 1], Hue.FAINT, Mark.THIN),
        ),
        is_plane=True,
        inset=_pitch(trial),
        inset_at=(0.14, 0.12) if run.case.is_down else (0.64, 0.12),
    )


def _pitch(trial: Trial) -> Panel:
    """Return the courses of both pitches."""
    thinned = slice(None, None, 50)
    time_s = trial.time_s[thinned]
    lines = (
        Series("", time_s, np.degrees(trial.reference[thinned, 3]), Hue.REFERENCE, Mark.DASHED),
        Series("", time_s, np.degrees(trial.state[thinned, 4]), Hue.PROPOSED),
    )
    return Panel("pitch (deg)", "time (s)", "", lines)
