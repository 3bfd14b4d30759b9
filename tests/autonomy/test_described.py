from dataclasses import dataclass

from pydantic import BaseModel, TypeAdapter

from autonomy.described import Described


class Place(Described, BaseModel):
    north_m: float
    """North of the datum."""
    east_m: float


class Mark(Place):
    class Kind(Described, BaseModel):
        name: str
        """What it is called."""

    kind: Kind
    """What stands there."""


@dataclass(frozen=True, slots=True)
class Row(Described):
    mark: Mark
    """The place of which it
    tells."""
    depth_m: float


@dataclass(frozen=True, slots=True)
class LongRow(Row):
    age_s: float
    """Since it was measured."""


def descriptions(schema):
    return {name: field.get("description") for name, field in schema["properties"].items()}


def test_a_docstring_describes_the_field_above_it_and_no_other():
    assert descriptions(Place.model_json_schema()) == {
        "north_m": "North of the datum.",
        "east_m": None,
    }


def test_fields_of_a_parent_keep_their_descriptions():
    assert descriptions(Mark.model_json_schema())["north_m"] == "North of the datum."
    found = descriptions(TypeAdapter(LongRow).json_schema())
    assert found == {
        "mark": "The place of which it\ntells.",
        "depth_m": None,
        "age_s": "Since it was measured.",
    }


def test_models_inside_of_others_are_described_too():
    inner = TypeAdapter(list[Row]).json_schema()["$defs"]
    assert descriptions(inner["Kind"]) == {"name": "What it is called."}
    assert descriptions(inner["Row"])["mark"] == "The place of which it\ntells."
