"""The controllers that know more than the thesis's: wrong masses, and a slow, late mass actuator.

``controller.governor`` is the robust one: it has to meet every bar here.
"""

import math
from typing import Any

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.governor_config import GOVERNOR_EXPERIMENT
from autonomy.vehicle.config import MINIGLIDER
from autonomy.whatif.config import (
    TABLE_3_1_LINEAR,
    TABLE_3_3_DIAGONAL,
    TABLE_3_3_FIGURE_EIGHT,
    ControllerChoice,
    DisturbanceConfig,
    SensingConfig,
    TrialConfig,
)
from autonomy.whatif.run import Trial, run_trial

OFFSET_BAR = 0.5
SWING_BAR_RAD = 0.1
SEEDS = range(1, 11)
UNTOLD_DRAWS, UNTOLD_SHARE = 200, 0.95
FIRST_DIVE_S = 75.0
TWO_DIVES = 1500
"""Commands of the last two dives of the diagonal at 10 Hz."""
TOLD = GOVERNOR_EXPERIMENT.model_copy(update={"mass_rate_share": 0.25, "mass_delay_s": 0.4})
"""The governor that knows of the slow, late mass."""
SLOW = DisturbanceConfig(
    net_buoyancy_error_kg=0.001, actuator_rate_share=0.25, actuator_delay_s=0.4
)


def measure() -> list[dict[str, Any]]:
    """Measure offsets, swinging, both at once, wrong knowledge, and the price of it all."""
    drawn = untold_actuators(int(np.random.default_rng().integers(2**32)))
    return [*_offsets(), *_slow_actuator(), *drawn]


def untold_actuators(seed: int, draws: int = UNTOLD_DRAWS) -> list[dict[str, Any]]:
    """Pitch errors of a governor that nobody told how slow and how late its mass is.

    Drawn when this runs: the rate, evenly in its logarithm from an eighth to the nominal one; the
    delay, evenly from 0 to 1 s; 1 g (standard deviation) of ballast; one of both references of the
    experiments; and the noise. The error is against the reference as it is asked for, which is
    nowhere slowed, after the first dive (75 s).

    Args:
        seed: Decides all draws; it is told with the result.
        draws: How many flights.
    """
    generator = np.random.default_rng(seed)
    pitch = np.empty(draws)
    for n in range(draws):
        scenario = (TABLE_3_3_DIAGONAL, TABLE_3_3_FIGURE_EIGHT)[int(generator.integers(2))]
        off = DisturbanceConfig(
            net_buoyancy_error_kg=0.001 * float(generator.standard_normal()),
            actuator_rate_share=float(2.0 ** generator.uniform(-3.0, 0.0)),
            actuator_delay_s=float(generator.uniform(0.0, 1.0)),
        )
        disturbed = scenario.model_copy(update={"disturbance": off})
        trial = run_trial(
            MINIGLIDER, disturbed, _choice("governor"), int(generator.integers(2**31))
        )
        pitch[n] = np.sqrt(np.mean(trial.errors[trial.time_s > FIRST_DIVE_S, 2] ** 2))
    met = int(np.count_nonzero(pitch <= SWING_BAR_RAD))
    low, high = share_interval(met, draws)
    title = "Untold mass, rate 1/8 to 1, delay 0 to 1 s"
    share = _row(
        f"{title}: flights with a pitch RMS <= {SWING_BAR_RAD:g} rad after the first dive,"
        f" {draws} draws, seed {seed} (95 %: {low:.3f} to {high:.3f})",
        met / draws,
        "",
    )
    share |= {"bar": UNTOLD_SHARE, "met": met / draws >= UNTOLD_SHARE}
    return [share, _row(f"{title}: pitch RMS, 95 % of flights", np.quantile(pitch, 0.95), "rad")]


def share_interval(count: int, of: int) -> tuple[float, float]:
    """Return the 95 % interval of a share by Wilson."""
    share, z2 = count / of, 1.96**2
    middle = (share + z2 / (2.0 * of)) / (1.0 + z2 / of)
    half = 1.96 * math.sqrt(share * (1.0 - share) / of + z2 / (4.0 * of**2)) / (1.0 + z2 / of)
    return middle - half, middle + half


def _offsets() -> list[dict[str, Any]]:
    """Offsets that wrong masses leave over the diagonal's last two dives, with a good actuator.

    An offset is half the difference between an error and its opposite: what the error itself
    moves, without what noise and the reference do to both. The plain mean stands beside it.
    """
    rows = []
    for what, error, column, unit in (
        ("2 g", {"net_buoyancy_error_kg": 0.002}, 0, "m"),
        ("2 g", {"net_buoyancy_error_kg": 0.002}, 2, "rad"),
        ("2 mm", {"mass_position_error_m": 0.002}, 2, "rad"),
    ):
        title = f"{'Depth' if column == 0 else 'Pitch'} offset by {what}"
        proposed = _offset("backstepping", error, column)
        rows.append(_row(f"{title}, proposed", proposed[0], unit))
        rows.append(_row(f"{title}, proposed, plain mean", proposed[1], unit))
        for key in ("governor", "integral"):
            half, plain = _offset(key, error, column)
            rows.append(_row(f"{title}, {key}", half, unit))
            rows.append(_row(f"{title}, {key}, plain mean", plain, unit))
            ratio = abs(half / proposed[0])
            rows.append(_row(f"{title}, {key} against proposed", ratio, "", OFFSET_BAR))
    glide = TABLE_3_1_LINEAR.model_copy(update={"control_period_s": 0.1})
    for key in ("backstepping", "governor", "integral", "baseline", "pid"):
        rms = float(run_trial(MINIGLIDER, glide, _choice(key), 1).rms()[1])
        rows.append(_row(f"Linear glide, horizontal RMS, {key}", rms, "m"))
    return rows


def _offset(
    key: str, error: dict[str, float], column: int, config: Any = None, **actuator: float
) -> tuple[float, float]:
    """Half the difference of the mean errors of +error and -error, and the mean of +error."""
    means = []
    for sign in (1.0, -1.0):
        signed = {name: sign * value for name, value in error.items()}
        off = DisturbanceConfig.model_validate(signed | actuator)
        trials = _trials(key, TABLE_3_3_DIAGONAL, off, config)
        means.append(float(np.mean([one.errors[-TWO_DIVES:, column].mean() for one in trials])))
    return (means[0] - means[1]) / 2.0, means[0]


def _slow_actuator() -> list[dict[str, Any]]:
    """Pitch with the mass actuator at a quarter of its rate and 0.4 s late, worst of ten seeds."""
    rows = []
    for title, scenario in (
        ("Eq. 3.21", TABLE_3_3_DIAGONAL),
        ("Eq. 3.22", TABLE_3_3_FIGURE_EIGHT),
    ):
        for key in ("governor", "integral", "backstepping", "baseline", "pid"):
            told = TOLD if key == "governor" else None
            name = f"{title}, slow late mass, pitch RMS, {key}"
            bar = SWING_BAR_RAD if told else None
            rows.append(_row(name, _worst_pitch(key, scenario, SLOW, told), "rad", bar))
    untold = _worst_pitch("governor", TABLE_3_3_DIAGONAL, SLOW)
    title = "Eq. 3.21, slow late mass, pitch RMS, governor not told, first dive included"
    rows.append(_row(title, untold, "rad"))
    return [*rows, *_slow_glide(), *_slow_and_wrong(), *_told_wrong(), *_nominal()]


def _slow_glide() -> list[dict[str, Any]]:
    """Swinging on the linear glide, where pitch errors are wanted: they win back distance."""
    glide = TABLE_3_1_LINEAR.model_copy(
        update={"control_period_s": 0.1, "duration_s": 225.0, "sensing": SensingConfig(exact=False)}
    )
    rows = []
    for key in ("governor", "integral", "backstepping", "baseline", "pid"):
        told = TOLD if key == "governor" else None
        trials = _trials(key, glide, SLOW, told)
        swing = max(_swing(trial.state[:, 4]) for trial in trials)
        pitch = max(float(trial.rms()[2]) for trial in trials)
        title = "Linear glide, slow late mass"
        bar = SWING_BAR_RAD if told else None
        rows.append(
            _row(f"{title}, swing of the pitch about its 20 s mean, {key}", swing, "rad", bar)
        )
        rows.append(_row(f"{title}, pitch RMS with the wanted error, {key}", pitch, "rad"))
    return rows


def _swing(pitch: FloatArray) -> float:
    """Root mean square of a pitch about its moving mean over 20 s at 10 Hz."""
    mean = np.convolve(pitch, np.full(201, 1.0 / 201.0), "valid")
    return float(np.sqrt(np.mean((pitch[100:-100] - mean) ** 2)))


def _slow_and_wrong() -> list[dict[str, Any]]:
    """Both troubles at once: 2 g that nobody sees and the slow, late mass."""
    slow = {"actuator_rate_share": 0.25, "actuator_delay_s": 0.4}
    off = DisturbanceConfig.model_validate({"net_buoyancy_error_kg": 0.002, **slow})
    wrong = DisturbanceConfig.model_validate({**SLOW.model_dump(), "parameter_error": 0.1})
    heavy = {"net_buoyancy_error_kg": 0.002}
    proposed, _ = _offset("backstepping", heavy, 0, None, **slow)
    robust, _ = _offset("governor", heavy, 0, TOLD, **slow)
    pitch = _worst_pitch("governor", TABLE_3_3_DIAGONAL, off, TOLD)
    by_model = _worst_pitch("governor", TABLE_3_3_DIAGONAL, wrong, TOLD)
    title = "Eq. 3.21, slow late mass"
    return [
        _row(f"{title} and 2 g, pitch RMS, governor", pitch, "rad", SWING_BAR_RAD),
        _row(f"{title} and 2 g, depth offset, proposed", proposed, "m"),
        _row(f"{title} and 2 g, depth offset, governor", robust, "m"),
        _row(f"{title} and 2 g, offset against proposed", abs(robust / proposed), "", OFFSET_BAR),
        _row(f"{title} and 10 % wrong parameters, pitch RMS, governor", by_model, "rad"),
    ]


def _told_wrong() -> list[dict[str, Any]]:
    """The governor believes in a quarter of the rate and 0.4 s; the actuator is another one."""
    return [
        _row(
            f"Eq. 3.21, told 1/4 and 0.4 s, true {share:g} and {delay_s:g} s, pitch RMS, governor",
            _worst_pitch(
                "governor",
                TABLE_3_3_DIAGONAL,
                SLOW.model_copy(update={"actuator_rate_share": share, "actuator_delay_s": delay_s}),
                TOLD,
            ),
            "rad",
            SWING_BAR_RAD,
        )
        for share, delay_s in ((0.25, 0.2), (0.25, 0.6), (0.125, 0.4), (0.5, 0.4), (1.0, 0.0))
    ]


def _nominal() -> list[dict[str, Any]]:
    """What the governor costs where neither offset nor slow mass is there."""
    plain = GOVERNOR_EXPERIMENT.model_copy(
        update={"k_depth_integral": 0.0, "k_pitch_integral": 0.0}
    )
    none = DisturbanceConfig()
    means = {
        title: np.mean(
            [one.rms() for one in _trials(key, TABLE_3_3_DIAGONAL, none, config)], axis=0
        )
        for title, key, config in (
            ("proposed", "backstepping", None),
            ("governor", "governor", None),
            ("governor without integrals", "governor", plain),
        )
    }
    rows = []
    for title, bar in (("governor without integrals", 1.01), ("governor", None)):
        for column, name in ((1, "horizontal"), (2, "pitch"), (3, "hybrid")):
            ratio = float(means[title][column] / means["proposed"][column])
            words = f"Eq. 3.21, nominal mass, {name} RMS, {title} against proposed"
            rows.append(_row(words, ratio, "", bar))
    return rows


def _choice(key: str, config: Any = None) -> ControllerChoice:
    kind = CONTROLLERS[f"controller.{key}"]
    return ControllerChoice(kind.key, kind.title, config or kind.preset("miniglider"))


def _trials(
    key: str, scenario: TrialConfig, off: DisturbanceConfig, config: Any = None
) -> list[Trial]:
    disturbed = scenario.model_copy(update={"disturbance": off})
    return [run_trial(MINIGLIDER, disturbed, _choice(key, config), seed) for seed in SEEDS]


def _worst_pitch(
    key: str, scenario: TrialConfig, off: DisturbanceConfig, config: Any = None
) -> float:
    return max(float(one.rms()[2]) for one in _trials(key, scenario, off, config))


def _row(name: str, value: float, unit: str, bar: float | None = None) -> dict[str, Any]:
    met = None if bar is None else bool(value <= bar)
    row = {"area": "control", "name": name, "value": float(value)}
    return row | {"unit": unit, "bar": bar, "met": met}


if __name__ == "__main__":
    for row in measure():
        print(row)
