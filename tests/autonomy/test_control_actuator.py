"""Rate and delay of an actuator are learned from its feedback, and the governor uses them."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from autonomy.control import actuator_kernel as bank_of
from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.feasibility import InfeasibleReferenceError
from autonomy.vehicle.config import MINIGLIDER
from autonomy.whatif.check import check_scenario
from autonomy.whatif.config import (
    TABLE_3_3_DIAGONAL,
    TABLE_3_3_FIGURE_EIGHT,
    ControllerChoice,
)
from autonomy.whatif.run import run_trial
from tests.autonomy.test_control import random_reference, random_state

LIMITS = MINIGLIDER.limits
TRAVEL_M = LIMITS.rp1_max_m - LIMITS.rp1_min_m
KIND = CONTROLLERS["controller.governor"]
PERIOD_S = 0.1
PARTS = 5


@dataclass
class Slider:
    """A sliding mass that is slow and late, and its noisy feedback."""

    share: float
    delay_s: float
    place_m: float = 0.0

    def __post_init__(self) -> None:
        self.sent: list[float] = []
        self.generator = np.random.default_rng(1)

    def follow(self, command_m: float) -> float:
        """Take a command, move for one period, and return the feedback."""
        self.sent.append(command_m)
        for part in range(PARTS):
            late = (len(self.sent) - 1) + part / PARTS - self.delay_s / PERIOD_S
            target = self.sent[math.floor(late + 1e-9)] if late > -1e-9 else 0.0
            most = self.share * LIMITS.rp1_rate_m_s * PERIOD_S / PARTS
            self.place_m += min(max(target - self.place_m, -most), most)
        return self.place_m + 2e-4 * float(self.generator.standard_normal())


def look(bank, slider, command_m, *, told_share=1.0, told_delay_s=0.0):
    bank_of.look_at(
        bank,
        command_m,
        slider.follow(command_m),
        LIMITS.rp1_rate_m_s,
        TRAVEL_M,
        told_share,
        told_delay_s,
        PERIOD_S,
    )


def learned(slider, seconds=75.0, bank=None, **told):
    """Let a mass go to and fro every 20 s and return what was learned of it."""
    bank = np.zeros(bank_of.BANK_SIZE) if bank is None else bank
    for k in range(round(seconds / PERIOD_S)):
        look(bank, slider, 0.03 if (k * PERIOD_S) % 40.0 < 20.0 else -0.03, **told)
    return bank


@pytest.mark.parametrize("share", [1.0, 0.5, 0.2, 0.125])
@pytest.mark.parametrize("delay_s", [0.0, 0.35, 1.0])
def test_rate_and_delay_are_learned_in_one_dive(share, delay_s):
    bank = learned(Slider(share, delay_s))
    assert 2.0 ** bank[bank_of.LOG_RATE] == pytest.approx(share, rel=0.1)
    assert bank[bank_of.DELAY_S] == pytest.approx(delay_s, abs=0.15)
    assert bank[bank_of.LOG_RATE_STD] < 0.2
    is_nominal = (share, delay_s) == (1.0, 0.0)
    assert (bank[bank_of.TOLD_AGAINST] <= bank_of.REFUTED) == is_nominal


def test_gentle_commands_say_nothing_of_the_rate():
    bank, slider = np.zeros(bank_of.BANK_SIZE), Slider(0.5, 0.6)
    for k in range(750):
        look(bank, slider, 0.03 * math.sin(2.0 * math.pi * k * PERIOD_S / 75.0))
    assert bank[bank_of.LOG_RATE_STD] > bank_of.UNCLEAR_OCTAVES
    assert bank[bank_of.DELAY_S] == pytest.approx(0.6, abs=0.1)
    assert bank_of.known_rate.py_func(bank, 0, 1.0) == 1.0


def test_actuator_that_becomes_slow_is_known_again_within_a_dive():
    slider = Slider(1.0, 0.0)
    bank = learned(slider, 300.0)
    slider.share = 0.25
    learned(slider, 75.0, bank)
    assert 2.0 ** bank[bank_of.LOG_RATE] == pytest.approx(0.25, rel=0.1)


def test_what_was_told_right_is_kept_to_the_digit():
    bank = learned(Slider(0.25, 0.4), told_share=0.25, told_delay_s=0.4)
    assert bank_of.known_rate.py_func(bank, 0, 0.25) == 0.25
    assert bank_of.known_delay.py_func(bank, 0, 0.4) == 0.4


def test_readings_that_are_no_numbers_teach_nothing():
    bank = learned(Slider(0.25, 0.4))
    before = bank.copy()
    bank_of.look_at(bank, 0.0, math.nan, LIMITS.rp1_rate_m_s, TRAVEL_M, 1.0, 0.0, PERIOD_S)
    bank_of.look_at(bank, math.inf, 0.0, LIMITS.rp1_rate_m_s, TRAVEL_M, 1.0, 0.0, PERIOD_S)
    assert np.array_equal(bank, before)


def disturbed(scenario, share, delay_s):
    off = scenario.disturbance.model_copy(
        update={"actuator_rate_share": share, "actuator_delay_s": delay_s}
    )
    return scenario.model_copy(update={"disturbance": off})


def choice(**told) -> ControllerChoice:
    return ControllerChoice(KIND.key, KIND.title, KIND.preset("miniglider").model_copy(update=told))


@pytest.mark.parametrize("scenario", [TABLE_3_3_DIAGONAL, TABLE_3_3_FIGURE_EIGHT])
@pytest.mark.parametrize(("share", "delay_s"), [(1.0, 1.0), (0.4, 0.3), (0.125, 0.7)])
def test_untold_actuator_does_not_swing_after_the_first_dive(scenario, share, delay_s):
    trial = run_trial(MINIGLIDER, disturbed(scenario, share, delay_s), choice(), 1)
    after = trial.errors[trial.time_s > 75.0, 2]
    assert math.sqrt(np.mean(after**2)) <= 0.1


def test_reference_that_the_told_mass_cannot_follow_is_refused():
    check_scenario(MINIGLIDER, TABLE_3_3_DIAGONAL, [choice(mass_rate_share=0.25)])
    with pytest.raises(InfeasibleReferenceError, match=r"moves the sliding mass at .* reaches 0.9"):
        check_scenario(MINIGLIDER, TABLE_3_3_DIAGONAL, [choice(mass_rate_share=0.075)])


def test_controller_counts_on_what_is_known_of_the_mass_until_that_is_forgotten():
    rng = np.random.default_rng(3)
    told, known, never = (KIND.make(MINIGLIDER, choice().config) for _ in range(3))
    slow = KIND.make(MINIGLIDER, choice(mass_rate_share=0.25, mass_delay_s=0.5).config)
    state, reference = random_state(rng), random_reference(rng)
    for law in (known, slow, told, never):
        law.hear(0.002, 0.01, 0.0)
    known.know_mass(0.25, 0.5)
    told.know_mass(0.25, 0.5)
    told.forget_mass()
    assert known.command(state, reference, 0.1) == slow.command(state, reference, 0.1)
    plain = never.command(state, reference, 0.1)
    assert told.command(state, reference, 0.1) == plain
    assert known.command(state, reference, 0.1) != plain
