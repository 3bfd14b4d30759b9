"""Vehicles as documents: exact there and back, and every slip named with what is allowed."""

import copy
import json
import math
import subprocess
import sys

import pytest

from autonomy.vehicle.config import GRACE3, MINIGLIDER, VEHICLES, VehicleParameters
from autonomy.vehicle.parameter_file import (
    SECTIONS,
    VehicleFileError,
    vehicle_document,
    vehicle_from_document,
)

TABLE_3_2 = list(VehicleParameters.model_fields)[:27]


def changed(path, value):
    document = copy.deepcopy(vehicle_document(MINIGLIDER))
    place = document
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return document


def without(path):
    document = copy.deepcopy(vehicle_document(MINIGLIDER))
    place = document
    for key in path[:-1]:
        place = place[key]
    del place[path[-1]]
    return document


def errors_of(document):
    with pytest.raises(VehicleFileError) as refused:
        vehicle_from_document(document)
    return {error.loc: error.message for error in refused.value.errors}


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=VEHICLES)
def test_a_vehicle_comes_back_from_its_document_as_it_was(vehicle):
    text = json.dumps(vehicle_document(vehicle), allow_nan=False)
    assert vehicle_from_document(json.loads(text)) == vehicle


def test_a_scaled_model_still_says_so_after_a_round_trip():
    again = vehicle_from_document(vehicle_document(GRACE3))
    assert again.note == "scaled, not identified"


def test_a_document_shows_every_number_with_its_unit():
    document = vehicle_document(MINIGLIDER)
    assert document["format"] == 1
    assert document["parameters"]["mass_1_kg"] == {"value": 15.011, "unit": "kg"}
    assert document["parameters"]["drag_0"] == {"value": 1.985, "unit": ""}
    assert document["limits"]["m0_max_kg"] == {"value": 0.0225, "unit": "kg"}
    assert document["hull"]["wingspan_m"] == {"value": 0.37, "unit": "m"}
    assert document["energy"]["electronics_w"] == {"value": 3.0, "unit": "W"}


@pytest.mark.parametrize("name", TABLE_3_2)
def test_every_parameter_of_table_3_2_is_required(name):
    errors = errors_of(without(("parameters", name)))
    assert list(errors) == [("parameters", name)]
    title = VehicleParameters.model_fields[name].title
    assert errors["parameters", name].startswith(f"missing; {title}: from ")


@pytest.mark.parametrize("section", SECTIONS)
def test_every_section_is_required(section):
    assert errors_of(without((section,)))[(section,)].startswith("missing")
    assert (section,) in errors_of(changed((section,), [1, 2]))


@pytest.mark.parametrize(
    "value",
    [-15.0, 0.0, math.nan, math.inf, -math.inf, True, "15", None, [15.0], 10**400, 1e300, 1e-300],
)
def test_a_mass_that_is_none_is_refused_with_the_allowed_range(value):
    errors = errors_of(changed(("parameters", "mass_1_kg", "value"), value))
    message = errors["parameters", "mass_1_kg", "value"]
    assert message.endswith("Mass, forward: from 1e-09 to 1000000000 kg")


@pytest.mark.parametrize("unit", ["g", "KG", "", " kg", None, 1])
def test_a_wrong_unit_is_refused_with_the_right_one(unit):
    errors = errors_of(changed(("parameters", "mass_1_kg", "unit"), unit))
    assert 'must be "kg"' in errors["parameters", "mass_1_kg", "unit"]


def test_a_bare_number_without_unit_is_refused():
    errors = errors_of(changed(("parameters", "drag_0"), 1.985))
    assert 'must be {"value": number, "unit": ""}' in errors["parameters", "drag_0"]
    errors = errors_of(without(("parameters", "area_m2", "unit")))
    assert 'missing; must be "m2"' in errors["parameters", "area_m2", "unit"]


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("colour",), "red", "unknown"),
        (("parameters", "mass_4_kg"), {"value": 1.0, "unit": "kg"}, "unknown"),
        (("parameters", "mass_1_kg", "error"), 0.1, "unknown"),
        (("format",), 2, "must be 1"),
        (("format",), True, "must be 1"),
        (("key",), "../../etc", "1 to 40 of a-z"),
        (("key",), "", "1 to 40 of a-z"),
        (("key",), None, "1 to 40 of a-z"),
        (("title",), "  ", "1 to 80 characters"),
        (("title",), "x" * 81, "1 to 80 characters"),
        (("note",), 3, "at most 500 characters"),
        (("limits", "m0_min_kg", "value"), 0.001, "must be below 0"),
        (("limits", "rp1_max_m", "value"), -0.001, "must be above 0"),
        (("limits", "delta_max_rad", "value"), 4.0, "to 3.14159265358979 rad"),
        (("swim", "amplitude_rad", "value"), 1.0, "at most 0.418 rad"),
        (("swim", "rp1_m", "value"), 0.05, "-0.0555 to 0.0445 m"),
        (("hull", "tail_to_nose_m", "value"), 0.3, "at least the hull's length, 0.4 m"),
        (("hull", "compressibility_per_m", "value"), 0.1, "from 0 to 0.001 1/m"),
        (("energy", "pump_full_w", "value"), -6.0, "from 0 to 1000000000 W"),
    ],
)
def test_a_slip_is_refused_at_its_place(path, value, words):
    errors = errors_of(changed(path, value))
    assert list(errors) == [path]
    assert words in errors[path]


def test_all_errors_are_told_at_once():
    document = vehicle_document(MINIGLIDER)
    document["parameters"]["mass_1_kg"]["value"] = -1.0
    document["parameters"]["drag_0"]["unit"] = "kg"
    document["limits"]["wings"] = {"value": 1.0, "unit": "m"}
    del document["energy"]
    errors = errors_of(document)
    assert list(errors) == [
        ("parameters", "mass_1_kg", "value"),
        ("parameters", "drag_0", "unit"),
        ("limits", "wings"),
        ("energy",),
    ]


@pytest.mark.parametrize("document", [None, [], "vehicle", 3])
def test_something_else_than_an_object_is_refused(document):
    assert errors_of(document) == {(): "must be an object"}


def test_the_refusal_reads_as_one_sentence_each():
    with pytest.raises(VehicleFileError, match=r"parameters\.mass_1_kg\.value: out of range"):
        vehicle_from_document(changed(("parameters", "mass_1_kg", "value"), -1.0))


def test_reading_documents_does_not_load_the_compiler():
    program = (
        "import sys; import autonomy.vehicle.parameter_file, autonomy.vehicle.trim;"
        " sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], timeout=240).returncode == 0
