"""How the station speaks of a robot's actuators."""

from dataclasses import replace

import pytest

from autonomy.vehicle.config import MINIGLIDER
from server.fleet.actuator_words import actuators_text, actuators_view
from tests.robot_link.test_actuator_report import NEVER, REPORT

NOMINAL = replace(REPORT, is_mass_off=False, speed_share=1.0, mass=replace(NEVER, learned_age_s=3))


@pytest.mark.parametrize(
    ("report", "text"),
    [
        (
            REPORT,
            "The sliding mass moves at 3.1 mm/s (12.5 nominal) and answers 0.5 s late. Dives are"
            " flown at 50% of their planned speed, so that it can follow.",
        ),
        (NOMINAL, "The sliding mass follows its commands as the model says."),
        (replace(NOMINAL, mass=NEVER), "Nothing was learned of the sliding mass yet."),
        (
            replace(NOMINAL, mass=replace(NOMINAL.mass, rate_share=0.75)),
            "The sliding mass moves at 9.4 mm/s (12.5 nominal).",
        ),
        (
            replace(NOMINAL, mass=replace(NOMINAL.mass, delay_s=0.14)),
            "The sliding mass answers 0.1 s late.",
        ),
        (
            replace(NOMINAL, stuck=("pump", "tail")),
            "The pump and tail are stuck: told to move and stood still.",
        ),
        (
            replace(NOMINAL, is_swinging=True, speed_share=0.4),
            "Pitch and sliding mass swing; the robot flies its gentlest gait.",
        ),
    ],
)
def test_report_is_said_in_words(report, text):
    assert actuators_text(report, MINIGLIDER) == text


def test_age_of_what_was_learned_goes_on_with_that_of_the_report():
    view = actuators_view(REPORT, None, 30.0)
    assert view.mass.learned_age_s == 42.5
    assert view.pump.learned_age_s is None
    assert "25% of its nominal rate" in view.text
