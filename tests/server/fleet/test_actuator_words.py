"""How the station speaks of a robot's actuators, and what it keeps of them."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from autonomy.vehicle.config import MINIGLIDER
from server.access.role import Role
from server.fleet.actuator_words import actuators_text, actuators_view
from tests.robot_link.test_actuator_report import NEVER, REPORT
from tests.server.conftest import MINI, api_client, open_station, until
from tests.server.fake_link import state_report

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


async def test_reports_are_kept_over_a_restart_and_go_with_a_deployment(tmp_path, world):
    now = datetime.now(UTC)
    at = [now, now + timedelta(milliseconds=1)]
    told = [replace(REPORT, measured_at=one, received_at=one) for one in at]
    told[1] = replace(told[1], stuck=("sliding mass", "pump"))
    async with open_station(tmp_path, world) as station:
        world.tell(state_report(MINI, (1.2, 0.6, 0.0)))
        for one in told:
            world.tell(one)
        await until(lambda: station.fleet.status(MINI).actuator_report == told[1])
    async with open_station(tmp_path, world) as station, api_client(station, Role.VIEWER) as client:
        assert station.fleet.status(MINI).actuator_report == told[1]
        found = (await client.get("/api/deployments?robot=mini-1")).json()["deployments"]
        path = f"/api/deployments/{found[0]['id']}/export?format=actuators"
        file = await client.get(path)
    assert file.text.startswith("# SIMULATION")
    header, *rows = [one.split(",") for one in file.text.splitlines() if not one.startswith("#")]
    assert [one[header.index("stuck")] for one in rows] == ["", "sliding mass;pump"]
    assert [float(one[header.index("mass_rate_share")]) for one in rows] == [0.25, 0.25]
    assert "mini-1" in file.headers["content-disposition"]
