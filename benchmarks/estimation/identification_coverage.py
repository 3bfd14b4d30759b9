"""Whether the intervals of an identification hold what they promise.

Many small recordings of a known vehicle are identified from wrong starts; an interval is right if
it holds the truth. The fits of one recording are not independent, so the band that chance allows is
that of as many draws as there are recordings.

The truths far from the start are drawn when this runs: each free parameter of the Miniglider times
1 + U(-1, 1), ballast and feedback error, 6 to 12 flights of 20 s. A draw whose flight the model
cannot follow is drawn again.
"""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from autonomy.identification.config import (
    IDENTIFICATION_PRESETS,
    FreeParameters,
    IdentificationConfig,
    NoiseLevels,
)
from autonomy.identification.problem import problem_from
from autonomy.identification.recording import Recording
from autonomy.identification.result import IdentificationResult
from autonomy.identification.run import identify
from autonomy.identification.unknown import free_names
from autonomy.vehicle.config import MINIGLIDER, Vehicle
from robot_link.messages import OnboardPlanState
from simulator.fleet import MINI_1
from tests.autonomy.identification_flight import open_loop_recording
from tests.simulator.flight import Life, mission, vee

RECORDINGS = 100
FLIGHTS = (1, 2, 3, 4)
DIVES = 6
FAR_RECORDINGS = 60
FAR = 1.0
"""How far a truth may lie from where the search starts, as a part of that."""
LEAST_HELD, MOST_HELD = 0.90, 0.99
FALSE_STD = 3.0
START_ERROR = 0.15
TRUTH = MINIGLIDER.parameters.model_dump()
FREE = FreeParameters(
    masses=False,
    inertias=False,
    sliding_mass=False,
    offset_mass=False,
    side_force=False,
    roll_moment=False,
    yaw_moment=False,
)
SMALL = IdentificationConfig(
    method="least_squares",
    model="thesis",
    step_s=0.5,
    free=FREE,
    noise=NoiseLevels(fix_hold_s=0.0),
)


def measure() -> list[dict[str, Any]]:
    return [*_coverage(), *far_truths(int(np.random.default_rng().integers(2**32))), *_flights()]


def far_truths(seed: int, recordings: int = FAR_RECORDINGS) -> Iterator[dict[str, Any]]:
    """Identify vehicles of which each parameter may be up to ``FAR`` of it off.

    Args:
        seed: Decides all draws; it is told with the result.
        recordings: How many vehicles.
    """
    held: Counter[str] = Counter()
    all_of: Counter[str] = Counter()
    shares: list[tuple[int, int]] = []
    ended = 0
    for number in range(recordings):
        recording, truth = _far_flight(np.random.default_rng([seed, number]))
        result = _identified(MINIGLIDER, recording, SMALL)
        ended += result.is_converged
        sure = 0, 0
        for estimate in result.parameters:
            if estimate.std is None:
                continue
            is_held = abs(estimate.after - truth[estimate.name]) <= 1.96 * estimate.std
            all_of[estimate.verdict] += 1
            held[estimate.verdict] += is_held
            if estimate.verdict == "identified":
                sure = sure[0] + is_held, sure[1] + 1
        shares.append(sure)
    share = held["identified"] / max(all_of["identified"], 1)
    low, high = _interval(shares, np.random.default_rng(seed))
    title = f"Truths up to {FAR * 100:.0f} % off"
    yield _row(
        f"{title}: 95 % intervals that hold the truth, {all_of['identified']} identified of"
        f" {recordings} vehicles, seed {seed} (95 %: {low:.3f} to {high:.3f})",
        share,
        LEAST_HELD,
        met=share >= LEAST_HELD and low <= MOST_HELD,
    )
    weak = held["weak"] / max(all_of["weak"], 1)
    yield _row(f"{title}: intervals of weak ones, {all_of['weak']}", weak)
    yield _row(f"{title}: searches that end at a minimum", ended / recordings)


def _interval(shares: list[tuple[int, int]], generator: np.random.Generator) -> tuple[float, float]:
    """Return a bootstrap interval over vehicles of the share that is held."""
    table = np.array(shares)
    picked = table[generator.integers(len(table), size=(2000, len(table)))].sum(axis=1)
    low, high = np.quantile(picked[:, 0] / np.maximum(picked[:, 1], 1), [0.025, 0.975]).tolist()
    return low, high


def _far_flight(generator: np.random.Generator) -> tuple[Recording, dict[str, float]]:
    """Return the recording of a vehicle far from the Miniglider, and its truth."""
    while True:
        far = {
            name: TRUTH[name] * (1.0 + FAR * generator.uniform(-1.0, 1.0))
            for name in free_names(FREE)
        }
        vehicle = replace(MINIGLIDER, parameters=MINIGLIDER.parameters.model_copy(update=far))
        bias_kg, bias_m = 0.0005 * generator.standard_normal(), 0.001 * generator.standard_normal()
        try:
            recording = open_loop_recording(
                vehicle,
                generator,
                runs=int(generator.integers(6, 13)),
                duration_s=20.0,
                period_s=0.5,
                net_buoyancy_bias_kg=bias_kg,
                mass_position_bias_m=bias_m,
            )
        except ValueError:
            continue
        truth = TRUTH | far
        truth |= {"net_buoyancy_offset_kg": bias_kg, "mass_position_offset_m": bias_m}
        return _with_feedback_noise(recording, generator), truth


def _row(
    name: str, value: float, bar: float | None = None, *, met: bool | None = None
) -> dict[str, Any]:
    row = {"area": "identification", "name": name, "value": value}
    return row | {"unit": "", "bar": bar, "met": met}


def _coverage() -> Iterator[dict[str, Any]]:
    held: Counter[str] = Counter()
    all_of: Counter[str] = Counter()
    for seed in range(RECORDINGS):
        generator = np.random.default_rng([11, seed])
        bias_kg, bias_m = 0.0005 * generator.standard_normal(), 0.001 * generator.standard_normal()
        recording = open_loop_recording(
            MINIGLIDER,
            generator,
            runs=6,
            duration_s=20.0,
            period_s=0.5,
            net_buoyancy_bias_kg=bias_kg,
            mass_position_bias_m=bias_m,
        )
        recording = _with_feedback_noise(recording, generator)
        result = _identified(_wrong(generator), recording, SMALL)
        truth = TRUTH | {"net_buoyancy_offset_kg": bias_kg, "mass_position_offset_m": bias_m}
        for estimate in result.parameters:
            if estimate.std is not None:
                all_of[estimate.verdict] += 1
                is_held = abs(estimate.after - truth[estimate.name]) <= 1.96 * estimate.std
                held[estimate.verdict] += is_held
    least = 0.95 - 1.96 * math.sqrt(0.95 * 0.05 / RECORDINGS)
    for verdict in ("identified", "weak"):
        share = held[verdict] / max(all_of[verdict], 1)
        yield _row(
            f"95 % intervals that hold the truth, {verdict}, {all_of[verdict]} of"
            f" {RECORDINGS} recordings (chance allows down to {least:.3f})",
            share,
            least,
            met=share >= least,
        )


def _with_feedback_noise(recording: Recording, generator: np.random.Generator) -> Recording:
    """Return what the simulated tank robot's instruments would have fed back."""
    noise = generator.standard_normal((3, recording.time_s.size))
    sensors = MINI_1.sensors
    return replace(
        recording,
        net_buoyancy_kg=recording.net_buoyancy_kg + sensors.buoyancy_std_kg * noise[0],
        mass_position_m=recording.mass_position_m + sensors.mass_position_std_m * noise[1],
        tail_rad=recording.tail_rad + sensors.tail_std_rad * noise[2],
    )


def _flights() -> Iterator[dict[str, Any]]:
    """Judge flights of the simulated tank robot, which reports once a second."""
    config = IDENTIFICATION_PRESETS["miniglider"].model_copy(
        update={"method": "least_squares", "free": FREE}
    )
    claimed = false = 0
    for seed in FLIGHTS:
        recording, truth = _flown(seed)
        result = _identified(MINIGLIDER, recording, config)
        for estimate in result.parameters:
            if estimate.verdict == "identified" and estimate.std is not None:
                claimed += 1
                off = abs(estimate.after - truth[estimate.name])
                false += off > FALSE_STD * estimate.std
    yield _row(
        f"Simulated flights, 1 s reports: of {claimed} 'identified' of {len(FLIGHTS)} seeds"
        f" beyond {FALSE_STD:.0f} of their deviations",
        float(false),
        0.0,
        met=claimed > 0 and false == 0,
    )


def _identified(
    start: Vehicle, recording: Recording, config: IdentificationConfig
) -> IdentificationResult:
    return identify(
        problem_from(start, recording, config),
        config,
        np.random.default_rng(config.seed),
        report=lambda _: None,
        is_cancelled=lambda: False,
    )


def _wrong(generator: np.random.Generator) -> Vehicle:
    wrong = {
        name: TRUTH[name] * (1.0 + START_ERROR * generator.uniform(-1.0, 1.0))
        for name in free_names(FREE)
    }
    return replace(MINIGLIDER, parameters=MINIGLIDER.parameters.model_copy(update=wrong))


def _flown(seed: int) -> tuple[Recording, dict[str, float]]:
    """Return the reports of a few dives to and fro, one a second, and the truth behind them."""
    legs = vee()
    for dive in range(1, DIVES):
        legs = (*legs, *vee(legs[-1].end_ned[:2], 3.5 if dive % 2 else 0.4))
    life = Life(MINI_1, seed)
    life.start(mission(*legs))
    rows: list[list[float]] = []
    while life.executive.plan_state is OnboardPlanState.RUNNING and len(rows) < 900:
        for _ in range(10):
            life.robot.step(life.notebook)
        said = life.robot.program.state_report()
        rows.append(
            [
                life.robot.program.time_s,
                *said.position_ned,
                said.position_std_m,
                float(said.has_fix),
                *(said.roll_rad, said.pitch_rad, said.heading_rad),
                *(said.net_buoyancy_kg, said.mass_position_m, said.tail_rad),
            ]
        )
    t = np.array(rows)
    sensors = life.robot.body.sensors
    return Recording(
        *(t[:, 0], t[:, 1:4], t[:, 4], t[:, 5] > 0.0, t[:, 6:9], t[:, 9], t[:, 10], t[:, 11])
    ), TRUTH | {
        "net_buoyancy_offset_kg": sensors.buoyancy_bias_kg,
        "mass_position_offset_m": sensors.mass_position_bias_m,
    }


if __name__ == "__main__":
    for row in measure():
        print(row)
