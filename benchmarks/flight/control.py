"""The controllers: faithful, fast, and better than the thesis's where it says they could be."""

import json
import math
import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from autonomy.campaign import Threads
from autonomy.control import law
from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.config import BACKSTEPPING_EXPERIMENT, BACKSTEPPING_SIMULATION
from autonomy.control.governor_config import GOVERNOR_EXPERIMENT
from autonomy.control.kernel import backstepping
from autonomy.control.trajectory import THESIS_REFERENCES
from autonomy.vehicle.config import MINIGLIDER
from autonomy.whatif.comparison import compare
from autonomy.whatif.config import (
    TABLE_3_1_LINEAR,
    ControllerChoice,
    DisturbanceConfig,
    SensingConfig,
    StartConfig,
    TrialConfig,
)
from autonomy.whatif.run import fly_setting, run_trial
from autonomy.whatif.setting import Setting, packed_references, setting
from benchmarks.calibration import COMPILED, best_of, calibrated, scaled_row
from benchmarks.flight import robust_control

GOLDEN = Path(__file__).parents[2] / "tests/autonomy/golden_vehicle.json"
SIMULATED_BAR, MONTE_CARLO_BAR_S, STEP_BAR_US = 12_000.0, 10.0, 1e3
"""Where the plain C step takes what ``calibration`` says of the reference machine."""
THREADS_BAR = 0.85
"""Share of what two threads gain that never need the interpreter."""
DIVES = TrialConfig(
    duration_s=600.0,
    step_s=0.05,
    control_period_s=0.1,
    start=StartConfig(position_scatter_m=1.0, heading_scatter_rad=0.5),
    disturbance=DisturbanceConfig(parameter_error=0.1),
    sensing=SensingConfig(exact=False),
    runs=200,
)


def measure() -> list[dict[str, Any]]:
    """Measure faithfulness, speed, and what ``robust_control`` asks of the robust controller."""
    return [*_faithful(), *_fast(), *_many_dives(), *robust_control.measure()]


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
    for key in ("backstepping", "pid"):
        kind = CONTROLLERS[f"controller.{key}"]
        choice = ControllerChoice(kind.key, kind.title, kind.simulation_preset)

        def fly(choice: ControllerChoice = choice) -> object:
            return fly_setting(MINIGLIDER, config, choice, drawn)

        with calibrated(COMPILED) as calibration:
            speed = config.duration_s / best_of(fly, 30)
        title = f"Simulated time, {key} in the loop, dt 0.01"
        if key == "backstepping":
            rows.append(
                scaled_row(
                    "control", title, speed, "s/s", SIMULATED_BAR, calibration, at_least=True
                )
            )
        else:
            rows.append(_row(title, speed, "s/s"))
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
        with calibrated(COMPILED) as calibration:
            seconds = best_of(calls, 30) / 200
        rows.append(scaled_row("control", title, seconds * 1e6, "us", STEP_BAR_US, calibration))
    return rows


def _many_dives() -> list[dict[str, Any]]:
    """Time the dives on one thread and on two, and on the same machine at the same moment what two
    threads gain that never need the interpreter: on a busy machine nothing can gain more."""
    choice = _choice("backstepping")
    compare(MINIGLIDER, DIVES.model_copy(update={"runs": 2}), [choice])
    long = DIVES.model_copy(update={"duration_s": 18_000.0, "sensing": SensingConfig()})
    drawn = setting(MINIGLIDER, long, 1, packed_references(MINIGLIDER, long))
    dives, alone = [math.inf, math.inf], [math.inf, math.inf]
    busy_s = math.inf
    with calibrated(COMPILED) as calibration:
        for _ in range(4):
            for n in range(2):
                begin, busy = time.perf_counter(), time.process_time()
                compare(MINIGLIDER, DIVES, [choice], spread=Threads(n + 1))
                dives[n] = min(dives[n], time.perf_counter() - begin)
                busy_s = min(busy_s, time.process_time() - busy)
                begin = time.perf_counter()
                _kernels_alone(long, drawn, n + 1)
                alone[n] = min(alone[n], time.perf_counter() - begin)
    title = "Monte-Carlo, 200 dives of 600 s, processor time"
    rows = [scaled_row("control", title, busy_s, "s", MONTE_CARLO_BAR_S, calibration)]
    title = "Monte-Carlo, gain of two threads / what two kernels alone gained meanwhile"
    if (os.cpu_count() or 1) < 2:
        return [*rows, _row(title, None, "skipped: one core", THREADS_BAR)]
    gain, most = dives[0] / dives[1], 2.0 * alone[0] / alone[1]
    return [
        *rows,
        _row(title, gain / most, "x", THREADS_BAR, at_least=True),
        _row("Monte-Carlo, two threads against one", gain, "x"),
        _row("Two threads of one kernel call each, what this machine gave meanwhile", most, "x"),
    ]


def _kernels_alone(config: TrialConfig, drawn: Setting, threads: int) -> None:
    """Fly one long dive in each thread, as one call that holds no lock."""
    choice = _choice("backstepping")
    with ThreadPoolExecutor(threads) as pool:
        calls = [
            pool.submit(fly_setting, MINIGLIDER, config, choice, drawn) for _ in range(threads)
        ]
        for call in calls:
            call.result()


def _choice(key: str) -> ControllerChoice:
    kind = CONTROLLERS[f"controller.{key}"]
    return ControllerChoice(kind.key, kind.title, kind.preset("miniglider"))


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
