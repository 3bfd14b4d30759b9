"""How much a comparison asks the machine to do, and the one limit on it."""

from collections.abc import Sequence

from autonomy.control.governor_config import GovernorConfig
from autonomy.vehicle.config import Vehicle
from autonomy.whatif.config import ControllerChoice, TrialConfig

MOST_STEPS_TOGETHER = 100_000_000
"""Most steps of the model in one comparison, all runs of all controllers: one to four minutes of
one processor, at 0.4 to 2.2 us a step with its law, sensors and observer. ``TrialConfig`` bounds
the memory of one run by its own ``MOST_STEPS``; a comparison keeps a few hundred rows of each."""
_STIFF, _MOST_PARTS = 1.5, 1000
"""As the extended model cuts its steps where the water's pitch damping would make them unstable."""


class TooMuchWorkError(ValueError):
    """A comparison takes more steps than a station works out; the message has both figures."""


def planned_steps(
    vehicle: Vehicle, config: TrialConfig, choices: Sequence[ControllerChoice]
) -> int:
    """Steps of the model that a comparison takes, predictions of its controllers included.

    Args:
        vehicle: The robot.
        config: The scenario.
        choices: The controllers.
    """
    flown = config.steps_per_period
    if config.model == "extended":
        flown *= _parts(vehicle, config)
        if not config.sensing.exact:
            flown += config.steps_per_period  # the observer's own model
    predicted = [_prediction_calls(choice, config.period_s) for choice in choices]
    return config.runs * config.periods * (flown * len(choices) + sum(predicted))


def check_work(vehicle: Vehicle, config: TrialConfig, choices: Sequence[ControllerChoice]) -> None:
    """Refuse a comparison that would take too long.

    Args:
        vehicle: The robot.
        config: The scenario.
        choices: The controllers.

    Raises:
        TooMuchWorkError: With the figures and what to change.
    """
    steps = planned_steps(vehicle, config, choices)
    if steps <= MOST_STEPS_TOGETHER:
        return
    runs = "1 run" if config.runs == 1 else f"{config.runs} runs"
    laws = "1 controller" if len(choices) == 1 else f"{len(choices)} controllers"
    calls = sum(_prediction_calls(choice, config.period_s) for choice in choices)
    share = config.runs * config.periods * calls
    predicted = f", {_rounded(share)} of them to predict" if share else ""
    raise TooMuchWorkError(
        f"{runs} of {laws} over {config.duration_s:g} s are {_rounded(steps)} steps of the"
        f" model{predicted}; at most {_rounded(MOST_STEPS_TOGETHER)} are worked out: take fewer"
        " runs or controllers, a shorter duration, or a longer step or control period"
    )


def _prediction_calls(choice: ControllerChoice, period_s: float) -> int:
    config = choice.config
    return config.delay_calls(period_s) if isinstance(config, GovernorConfig) else 0


def _parts(vehicle: Vehicle, config: TrialConfig) -> int:
    """Into how many parts the extended model cuts a step at the speed of a fall or rise."""
    p, limits = vehicle.parameters, vehicle.limits
    heaviest = max(abs(limits.m0_min_kg), abs(limits.m0_max_kg))
    heaviest += abs(config.disturbance.net_buoyancy_error_kg)
    if p.drag_0 <= 0.0:
        return 1 + _MOST_PARTS
    pressure = heaviest * p.gravity_m_s2 / p.drag_0
    damping = pressure * abs(p.pitch_damping_m_s) / p.inertia_2_kg_m2
    return 1 + int(min(damping * config.step_s / _STIFF, _MOST_PARTS))


def _rounded(steps: int) -> str:
    digits, exponent = f"{steps:.1e}".split("e")
    return f"{float(digits):g}e{int(exponent)}"
