"""Offsets of actuators that an identification found: named, offered as a trim, accepted."""

import asyncio

import numpy as np
import pytest

from autonomy.identification.config import NoiseLevels
from autonomy.identification.result import IdentificationResult, ParameterEstimate
from autonomy.vehicle.config import GRACE3, MINIGLIDER
from autonomy.vehicle.trim import TrimConfig
from server.study.identified import note_of, offered_trim, offsets_of
from server.study.view import ActuatorOffsetView
from tests.autonomy.identification_flight import open_loop_recording
from tests.server.study.test_identification_api import QUICK, deployed, ended, start

pytestmark = pytest.mark.usefixtures("in_threads")

BIAS_KG = 0.003
BUOYANCY = ActuatorOffsetView(
    name="net_buoyancy_offset_kg", unit="kg", value=0.004, std=0.0002, verdict="identified"
)
POSITION = ActuatorOffsetView(
    name="mass_position_offset_m", unit="m", value=0.001, std=None, verdict="not identifiable"
)


@pytest.fixture(scope="module")
def recording():
    """A Miniglider that is 3 g lighter than its pump believes."""
    return open_loop_recording(
        MINIGLIDER,
        np.random.default_rng(5),
        runs=2,
        duration_s=30.0,
        period_s=0.2,
        noise=NoiseLevels(),
        net_buoyancy_bias_kg=BIAS_KG,
    )


@pytest.fixture
async def search(client, station, recording):
    begun = await start(
        client, await deployed(station, recording), {**QUICK, "descents": 40, "fits_offsets": True}
    )
    found = await ended(client, begun)
    assert found["state"] == "done", found["message"]
    return begun["id"]


async def test_the_trim_that_belongs_to_an_identified_vehicle_is_offered_with_it(client, search):
    accepted = (await client.post(f"/api/identifications/{search}/accept")).json()
    key = accepted["vehicle"]
    found = {one["name"]: one for one in accepted["offsets"]}
    assert found["net_buoyancy_offset_kg"]["value"] == pytest.approx(BIAS_KG, abs=0.0006)
    note = (await client.get(f"/api/vehicles/{key}")).json()["note"]
    assert "offsets of the actuators' feedback: net buoyancy +" in note
    advice = accepted["trim_advice"]
    assert advice["full_step"]["net_buoyancy_offset_kg"] == pytest.approx(
        found["net_buoyancy_offset_kg"]["value"]
    )
    assert (advice["vehicle"], advice["identification"]) == (key, search)

    path, body = "/api/robots/mini-1/trim/accept", {"advice": advice["id"], "share": 1.0}
    refused = await client.post(path, json=body)
    assert refused.status_code == 409
    assert f"for the vehicle {key}, which mini-1 is not now" in refused.json()["detail"]
    await client.patch("/api/robots/mini-1", json={"model": key})
    taken = await client.post(path, json=body)
    assert taken.status_code == 200, taken.text
    held = (await client.get("/api/config/trim?robot=mini-1")).json()["value"]
    assert held == advice["full_step"]


async def test_a_search_that_two_accept_at_once_becomes_one_vehicle(client, search):
    path = f"/api/identifications/{search}/accept"
    answers = await asyncio.gather(
        *(client.post(path, json={"key": key}) for key in ("mini-b", "mini-c"))
    )
    assert sorted(answer.status_code for answer in answers) == [201, 409]
    listed = (await client.get("/api/vehicles")).json()["vehicles"]
    assert len([one for one in listed if one["origin"] == "identified"]) == 1


def test_an_offset_that_the_data_do_not_tell_stays_as_the_robot_has_it():
    present = TrimConfig(mass_position_offset_m=0.002)
    offered = offered_trim("identification-1", [BUOYANCY, POSITION], present, MINIGLIDER)
    assert offered.advice is not None
    assert offered.advice.full_step.model_dump() == {
        "net_buoyancy_offset_kg": 0.004,
        "mass_position_offset_m": 0.002,
    }
    assert offered.advice.half_step.net_buoyancy_offset_kg == 0.002
    assert offered.advice.mass_position_std_m is None
    assert offered.advice.is_worth_it
    assert "net buoyancy +4.00 g (±0.20)" in offered.message
    assert "mass position" not in offered.message


def test_a_small_offset_is_not_worth_a_change_of_trim():
    present = TrimConfig(net_buoyancy_offset_kg=0.0038)
    offered = offered_trim("identification-1", [BUOYANCY], present, MINIGLIDER)
    assert offered.advice is not None
    assert not offered.advice.is_worth_it


@pytest.mark.parametrize(
    ("offset", "reason"),
    [
        (POSITION, "does not tell offsets"),
        (BUOYANCY.model_copy(update={"value": 0.02}), "beyond 30% of the actuator's travel"),
        (BUOYANCY.model_copy(update={"value": 0.5}), "beyond what a trim can hold"),
    ],
)
def test_a_trim_that_could_not_be_held_is_not_offered(offset, reason):
    offered = offered_trim("identification-1", [offset], TrimConfig(), MINIGLIDER)
    assert offered.advice is None
    assert reason in offered.message


def test_travel_decides_whether_a_trim_is_offered():
    heavy = BUOYANCY.model_copy(update={"value": 0.02})
    assert offered_trim("identification-1", [heavy], TrimConfig(), GRACE3).advice is not None


def test_a_vehicle_s_note_names_what_was_found_with_it():
    assert note_of("identification-1", "deployment-2", []) == (
        "identified from deployment-2 by identification-1"
    )
    assert note_of("identification-1", "deployment-2", [BUOYANCY, POSITION]).endswith(
        "net buoyancy +4.00 g (±0.20) and mass position +1.00 mm (not identifiable)"
    )


def test_offsets_that_were_not_sought_are_none():
    values = {"unit": "m", "before": 0.0, "after": 0.0, "std": None, "title": "", "reason": ""}
    offset = ParameterEstimate(name="mass_position_offset_m", verdict="fixed", **values)
    drag = ParameterEstimate(name="drag_0", verdict="identified", **values)
    assert offsets_of(IdentificationResult.model_construct(parameters=[offset, drag])) == []
