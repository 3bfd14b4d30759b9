"""The controllers: faithful, fast, and better than the thesis's where it says they could be."""

import json
import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from autonomy.control import law
from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.config import BACKSTEPPING_EXPERIMENT, BACKSTEPPING_SIMULATION
from autonomy.control.governor_config import GOVERNOR_EXPERIMENT
from autonomy.control.kernel import backstepping
from autonomy.control.reference import THESIS_REFERENCES
from autonomy.trial.config import (
    TABLE_3_1_LINEAR,
    TABLE_3_3_DIAGONAL,
    TABLE_3_3_FIGURE_EIGHT,
    DisturbanceConfig,
    SensingConfig,
    StartConfig,
    TrialConfig,
)
from autonomy.trial.monte_carlo import monte_carlo
from autonomy.trial.run import ControllerChoice, fly_setting, run_trial
from autonomy.trial.setting import packed_references, setting
from autonomy.vehicle.config import MINIGLIDER

GOLDEN = Path(__file__).parents[1] / "tests/autonomy/golden_vehicle.json"
SIMULATED_BAR = 12_000.0
MONTE_CARLO_BAR_S, MONTE_CARLO_RATIO_BAR = 10.0, 1.7
OFFSET_BAR = 0.5
SWING_BAR_RAD = 0.1
STEP_BAR_S = 1e-3
SEEDS = range(1, 11)
TWO_DIVES = 1500
"""Commands of the last two dives of the diagonal at 10 Hz."""
DIVES = TrialConfig(
    duration_s=600.0,
    step_s=0.05,
    control_period_s=0.1,
    start=StartConfig(position_scatter_m=1.0, heading_scatter_rad=0.5),
    disturbance=DisturbanceConfig(parameter_error=0.1),
    sensing=SensingConfig(exact=False),
    runs=200,
)
SLOW = DisturbanceConfig(
    net_buoyancy_error_kg=0.001, actuator_rate_share=0.25, actuator_delay_s=0.4
)


def measure() -> list[dict[str, Any]]:
    """Measure faithfulness, speed and the claims of the two robust controllers."""
    return [*_faithful(), *_fast(), *_many_dives(), *_offsets(), *_slow_actuator()]


def _faithful() -> list[dict[str, Any]]:
    golden = json.loads(GOLDEN.read_text())
    worst = 0.0
    for case in golden["backstepping"]:
        gains = BACKSTEPPING_SIMULATION if case["gains"] == "sim" else BACKSTEPPING_EXPERIMENT
        gains = gains.model_copy(update={"tail_effect_min": case["f23min"]})
        reference = THESIS_REFERENCES[case["reference"]](case["t"])
        state, wanted = np.array(case["X"]), np.array(case["u"])
        inputs = backstepping(state, reference.packed(), gains.packed(), MINIGLIDER.packed())
        worst = max(worst, float(np.max(np.abs(inputs / wanted - 1.0))))
    rows = [_row("Control law against golden vectors, relative", worst, "", 1e-9)]
    worst = 0.0
    for name, key in (("prop", "backstepping"), ("bs", "baseline"), ("pid", "pid")):
        kind = CONTROLLERS[f"controller.{key}"]
        choice = ControllerChoice(kind.key, kind.title, kind.simulation_preset)
        rms = run_trial(MINIGLIDER, TABLE_3_1_LINEAR, choice, 1).rms()
        golden_rms = np.array(golden["closed_loop_rms"][f"linear/{name}"])
        worst = max(worst, float(np.max(np.abs(rms / golden_rms - 1.0))))
    return [*rows, _row("Closed-loop RMS against golden runs, relative", worst, "", 0.01)]


def _fast() -> list[dict[str, Any]]:
    config = TABLE_3_1_LINEAR.model_copy(update={"duration_s": 200.0})
    references = packed_references(MINIGLIDER, config)
    drawn = setting(MINIGLIDER, config, 1, references)
    rows = []
    for key, bar in (("backstepping", SIMULATED_BAR), ("pid", None)):
        kind = CONTROLLERS[f"controller.{key}"]
        choice = ControllerChoice(kind.key, kind.title, kind.simulation_preset)

        def fly(choice: ControllerChoice = choice) -> object:
            return fly_setting(MINIGLIDER, config, choice, drawn)

        speed = config.duration_s / _best_of(fly, 30)
        title = f"Simulated time, {key} in the loop, dt 0.01"
        rows.append(_row(title, speed, "s/s", bar, at_least=True))
    state = np.zeros(12)
    state[6] = 0.06
    knows = GOVERNOR_EXPERIMENT.model_copy(update={"mass_delay_s": 2.0})
    for kind in CONTROLLERS.values():
        config_ = knows if kind.key == "controller.governor" else kind.preset("miniglider")
        gains, memory = kind.packed(config_), np.zeros(law.MEMORY_SIZE)
        arguments = (kind.law, state, references[5], gains, MINIGLIDER.packed(), 0.1, memory)

        def calls(arguments: Any = arguments) -> None:
            for _ in range(200):
                law.command(*arguments)

        late = ", delay 2 s" if config_ is knows else ""
        title = f"One call of {kind.key}{late}"
        seconds = _best_of(calls, 30) / 200
        rows.append(_row(title, seconds * 1e6, "us", STEP_BAR_S * 1e6))
    return rows


def _many_dives() -> list[dict[str, Any]]:
    kind = CONTROLLERS["controller.backstepping"]
    choice = ControllerChoice(kind.key, kind.title, kind.preset("miniglider"))
    monte_carlo(MINIGLIDER, DIVES.model_copy(update={"runs": 2}), choice)
    best = [math.inf, math.inf]
    for _ in range(3):
        for n in range(2):
            begin = time.perf_counter()
            monte_carlo(MINIGLIDER, DIVES, choice, threads=n + 1)
            best[n] = min(best[n], time.perf_counter() - begin)
    rows = [_row("Monte-Carlo, 200 dives of 600 s, one core", best[0], "s", MONTE_CARLO_BAR_S)]
    title = "Monte-Carlo, two threads against one"
    if (os.cpu_count() or 1) < 2:
        return [*rows, _row(title, None, "skipped: one core", MONTE_CARLO_RATIO_BAR)]
    ratio = best[0] / best[1]
    return [*rows, _row(title, ratio, "x", MONTE_CARLO_RATIO_BAR, at_least=True)]


def _offsets() -> list[dict[str, Any]]:
    """Offsets of the diagonal's last two dives, the proposed controller beside the integral one.

    Half the difference between an error and its opposite: what the error itself moves, without
    what noise and the reference do to both.
    """
    rows = []
    for what, error in (
        ("2 g", {"net_buoyancy_error_kg": 0.002}),
        ("2 mm", {"mass_position_error_m": 0.002}),
    ):
        proposed, learning = (_offset(key, error) for key in ("backstepping", "integral"))
        for column, name, unit in ((0, "Depth", "m"), (2, "Pitch", "rad")):
            if what == "2 mm" and column == 0:
                continue
            title = f"{name} offset by {what}"
            rows += [
                _row(f"{title}, proposed", proposed[column], unit),
                _row(f"{title}, integral", learning[column], unit),
                _row(
                    f"{title}, integral against proposed",
                    learning[column] / proposed[column],
                    "",
                    OFFSET_BAR,
                ),
            ]
    glide = TABLE_3_1_LINEAR.model_copy(update={"control_period_s": 0.1})
    for key in ("backstepping", "integral", "baseline", "pid"):
        rms = float(np.mean([_rms(key, glide, seed)[1] for seed in (1,)]))
        rows.append(_row(f"Linear glide, horizontal RMS, {key}", rms, "m"))
    return rows


def _offset(key: str, error: dict[str, float]) -> np.ndarray:
    means = []
    for sign in (1.0, -1.0):
        off = DisturbanceConfig(**{name: sign * value for name, value in error.items()})
        scenario = TABLE_3_3_DIAGONAL.model_copy(update={"disturbance": off})
        trials = [run_trial(MINIGLIDER, scenario, _choice(key), seed) for seed in SEEDS]
        means.append(np.mean([one.errors[-TWO_DIVES:].mean(axis=0) for one in trials], axis=0))
    return np.abs(means[0] - means[1]) / 2.0


def _slow_actuator() -> list[dict[str, Any]]:
    """Pitch error with the mass actuator at a quarter of its rate and 0.4 s late, worst seed."""
    rows = []
    knows = GOVERNOR_EXPERIMENT.model_copy(update={"mass_rate_share": 0.25, "mass_delay_s": 0.4})
    late = TABLE_3_1_LINEAR.model_copy(
        update={"control_period_s": 0.1, "duration_s": 225.0, "sensing": SensingConfig(exact=False)}
    )
    for title, scenario, bar in (
        ("Eq. 3.21", TABLE_3_3_DIAGONAL, SWING_BAR_RAD),
        ("Eq. 3.22", TABLE_3_3_FIGURE_EIGHT, None),
        ("linear glide", late, None),
    ):
        slow = scenario.model_copy(update={"disturbance": SLOW})
        for key in ("governor", "backstepping", "baseline", "pid"):
            config = knows if key == "governor" else None
            worst = max(float(_rms(key, slow, seed, config)[2]) for seed in SEEDS)
            name = f"{title}, slow late mass, pitch RMS, {key}"
            rows.append(_row(name, worst, "rad", bar if key == "governor" else None))
    nominal = [
        float(np.mean([_rms(key, TABLE_3_3_DIAGONAL, seed)[2] for seed in SEEDS]))
        for key in ("governor", "backstepping")
    ]
    title = "Eq. 3.21, nominal mass, pitch RMS, governor against proposed"
    return [*rows, _row(title, nominal[0] / nominal[1], "", 1.01)]


def _choice(key: str, config: Any = None) -> ControllerChoice:
    kind = CONTROLLERS[f"controller.{key}"]
    return ControllerChoice(kind.key, kind.title, config or kind.preset("miniglider"))


def _rms(key: str, scenario: TrialConfig, seed: int, config: Any = None) -> np.ndarray:
    return run_trial(MINIGLIDER, scenario, _choice(key, config), seed).rms()


def _best_of(run: Callable[[], object], rounds: int) -> float:
    best = math.inf
    run()
    for _ in range(rounds):
        begin = time.perf_counter()
        run()
        best = min(best, time.perf_counter() - begin)
    return best


def _row(
    name: str, value: float | None, unit: str, bar: float | None = None, *, at_least: bool = False
) -> dict[str, Any]:
    met = None
    if bar is not None and value is not None:
        met = bool(value >= bar if at_least else value <= bar)
    value = None if value is None else float(value)
    return {"area": "control", "name": name, "value": value, "unit": unit, "bar": bar, "met": met}


if __name__ == "__main__":
    for row in measure():
        print(row)
