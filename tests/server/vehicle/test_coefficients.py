"""Coefficients from a table of forces and moments, and the command that finds them."""

import json
import math
from dataclasses import replace

import pytest

from autonomy.vehicle.config import MINIGLIDER
from autonomy.vehicle.parameter_file import vehicle_from_document
from server.cli.main import main
from server.vehicle.coefficients import (
    COLUMNS,
    CoefficientTableError,
    csv_rows,
    fit_vehicle,
    json_rows,
)
from tests.autonomy.test_identification_polynomial import table

KNOWN = MINIGLIDER.parameters
FOUND = {"drag_0", "drag_alpha", "lift_alpha", "side_beta", "yaw_delta_m", "pitch_alpha_m"}
OTHER = replace(
    MINIGLIDER,
    parameters=KNOWN.model_copy(update={"drag_0": 5.0, "lift_alpha": 1.0, "side_beta": -9.0}),
)


def rows(**changes):
    columns = {name: values.tolist() for name, values in table(0.01).items()} | changes
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def csv_text(given=None):
    given = rows() if given is None else given
    lines = [",".join("" if cell is None else repr(cell) for cell in row.values()) for row in given]
    return "\n".join([",".join(given[0]), *lines, ""])


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "tunnel.csv"
    path.write_text(csv_text())
    return path


def fitted(given, base=OTHER, **more):
    return fit_vehicle(base, given, key="tested", title="Tested", **more)


def test_a_table_gives_the_coefficients_back_with_their_standard_errors():
    found = fitted(csv_rows(csv_text()))
    by_name = {one.name: one for one in found.coefficients}
    assert set(by_name) >= FOUND
    for one in found.coefficients:
        assert abs(one.value - getattr(KNOWN, one.name)) < 4.5 * one.std
    assert (by_name["drag_0"].before, by_name["drag_alpha"].unit) == (5.0, "1/rad2")
    made = vehicle_from_document(found.document)
    assert made.parameters.drag_0 == by_name["drag_0"].value
    assert made.parameters.mass_1_kg == KNOWN.mass_1_kg
    assert (made.key, made.title) == ("tested", "Tested")


def test_degrees_and_radians_say_the_same():
    degrees = [
        {
            name.replace("_rad", "_deg"): math.degrees(value) if "_rad" in name else value
            for name, value in row.items()
        }
        for row in rows()
    ]
    first, second = fitted(json_rows(rows())), fitted(json_rows(degrees))
    for one, other in zip(first.coefficients, second.coefficients, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-9)


def test_a_force_that_was_not_measured_in_a_row_is_left_out_there():
    given = rows()
    for row in given[21:]:
        row["lift_n"] = None
    whole, part = fitted(json_rows(rows())), fitted(csv_rows(csv_text(given)))
    values = [{one.name: one.value for one in found.coefficients} for found in (whole, part)]
    assert values[0]["drag_0"] == values[1]["drag_0"]
    assert values[0]["lift_0"] != values[1]["lift_0"]
    assert values[1]["lift_alpha"] == pytest.approx(KNOWN.lift_alpha, rel=0.05)


def test_what_a_table_does_not_tell_is_kept():
    given = [{name: row[name] for name in row if name != "lift_n"} for row in rows()]
    found = fitted(json_rows(given))
    assert found.kept == ("lift_0", "lift_alpha")
    assert vehicle_from_document(found.document).parameters.lift_alpha == 1.0


def test_denser_water_gives_smaller_coefficients():
    fresh, salt = (fitted(json_rows(rows()), water_density_kg_m3=d) for d in (1000.0, 1025.0))
    assert fresh.coefficients[0].value == pytest.approx(1.025 * salt.coefficients[0].value)


@pytest.mark.parametrize(
    ("text", "place", "reason"),
    [
        ("", ("line", 1), "needs columns: speed_m_s"),
        ("speed_m_s,drag_n\n", ("table",), "needs rows"),
        (csv_text().replace("0.3", "fast", 1), ("line", 2, "speed_m_s"), "'fast' is no finite"),
        (csv_text().replace("0.3", "", 1), ("line", 2, "speed_m_s"), "is empty"),
        (csv_text().replace("\n", ",9\n").replace(",9", "", 1), ("line", 2, "surplus cells"), "no"),
        (csv_text().replace("alpha_rad", "alpha", 1), ("alpha",), "is unknown"),
        (csv_text().replace("beta_rad", "alpha_deg", 1), ("alpha_deg",), "leave one out"),
        (csv_text(rows()[:2]), ("lift_n",), "vary too little"),
    ],
)
def test_a_table_that_tells_nothing_is_refused_where_it_is_wrong(text, place, reason):
    with pytest.raises(CoefficientTableError) as refused:
        fitted(csv_rows(text))
    messages = [message for loc, message in refused.value.errors if loc == place]
    assert any(reason in message for message in messages), refused.value.errors


def test_coefficients_that_no_vehicle_has_are_refused_by_name():
    given = [{**row, "drag_n": row["drag_n"] * 1e12} for row in rows()]
    with pytest.raises(CoefficientTableError) as refused:
        fitted(json_rows(given))
    assert refused.value.errors[0][0] == ("parameters", "drag_0", "value")


def test_the_verb_prints_coefficients_and_writes_the_vehicle(file, tmp_path, capsys):
    out = tmp_path / "vehicle.json"
    words = ["coefficients", file, "--vehicle", "miniglider", "--key", "mini-t", "--out", out]
    assert main([str(word) for word in words]) == 0
    text = capsys.readouterr().out
    assert "standard error" in text
    assert all(name in text for name in ("drag_alpha", "yaw_delta_m", str(out)))
    made = vehicle_from_document(json.loads(out.read_text()))
    assert made.key == "mini-t"
    assert main(["coefficients", str(file), "--vehicle", str(out)]) == 0


def test_the_verb_s_help_names_every_column_with_its_unit(capsys):
    with pytest.raises(SystemExit):
        main(["coefficients", "--help"])
    text = capsys.readouterr().out
    assert all(f"{name} " in text and unit in text for name, unit in COLUMNS.items())


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--vehicle", "shark"], "There is no vehicle or file 'shark'"),
        (["--density", "-1"], "must be greater than 0"),
        (["--out", "/nowhere/vehicle.json"], "/nowhere/vehicle.json"),
    ],
)
def test_the_verb_refuses_in_words(file, words, sentence, capsys):
    assert main(["coefficients", str(file), *words]) != 0
    assert sentence in capsys.readouterr().err


def test_the_verb_names_each_wrong_cell(tmp_path, capsys):
    path = tmp_path / "broken.csv"
    path.write_text(csv_text().replace("0.3", "fast", 1))
    assert main(["coefficients", str(path)]) == 1
    captured = capsys.readouterr()
    assert "line 2 speed_m_s: 'fast' is no finite number" in captured.out
    assert "tells no coefficients" in captured.err
    assert main(["coefficients", str(tmp_path / "none.csv")]) == 1
