"""Who answers for the data of a robot, and under what names they are delivered.

Values are kept per robot and for the station, and offered again with the next deployment.
"""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from autonomy.configuration import Configuration


def _without_comma(name: str) -> str:
    """Return a name as it is; files join names with commas, so none may be in one."""
    if "," in name or "\n" in name or "\r" in name:
        raise ValueError(
            "may have no comma, which would make two of one: write Ann Lee, not Lee, Ann"
        )
    return name


ListPart = Annotated[str, AfterValidator(_without_comma)]


def _text(title: str, length_max: int = 200, pattern: str | None = None) -> str:
    return Field(default="", title=title, max_length=length_max, pattern=pattern)


class Contributor(Configuration):
    """A person who answers for a part of the data."""

    name: ListPart = _text("Name", 100)
    """Without a comma, which would make two people of one."""
    email: str = _text("E-mail", 200, r"^([^@,\s]+@[^@,\s]+)?$")
    """Where this person is reached; it is published with the data."""


class Sensor(Configuration):
    """The instrument that measures a channel."""

    kind: str = _text("Type", 40, r"^([A-Z][A-Z0-9_]*)?$")
    """In capitals, as OceanGliders name it, such as CTD or FLUOROMETER."""
    serial_number: str = _text("Serial number", 32, r"^[A-Za-z0-9_-]*$")
    """Letters, digits, dashes."""
    maker: str = _text("Maker", 100)
    """Who built it."""
    model: str = _text("Model", 100)
    """As its maker calls it."""
    calibrated_on: str = _text("Calibrated on", 10, r"^(\d{4}-\d{2}-\d{2})?$")
    """Such as 2026-03-14."""

    @property
    def variable(self) -> str:
        """Its name in a file; empty where type or serial number are not told."""
        if not (self.kind and self.serial_number):
            return ""
        return f"SENSOR_{self.kind}_{self.serial_number}".upper().replace("-", "_")


class DeliveryMetadata(Configuration):
    """What files of OG1.0 say besides the measurements."""

    platform_serial_number: str = _text("Serial number", 32, r"^([a-z0-9]+(_?[a-z0-9-]+)*)?$")
    """Of the robot, the first part of each file's name; by default its id."""
    wmo_identifier: str = _text("WMO identifier", 8, r"^(\d{5,8})?$")
    """Five to eight digits, where the robot has one."""
    platform_maker: str = _text("Maker")
    """Who built the robot."""
    battery_type: str = _text("Battery type")
    """Such as lithium primary."""
    firmware_version: str = _text("Firmware version")
    """Of the program on board."""
    title: str = _text("Title of the file")
    """By default "OceanGliders trajectory file"."""
    summary: str = _text("Summary", 2000)
    """What was done, and what for; by default the purpose of the deployment."""
    comment: str = _text("Comment", 2000)
    """What users of the data must know."""
    principal_investigator: Contributor = Field(
        default=Contributor(), title="Principal investigator"
    )
    """Who answers for the data; must be named."""
    operator: Contributor = Field(default=Contributor(), title="Operator")
    """Who flew the robot."""
    data_manager: Contributor = Field(default=Contributor(), title="Data manager")
    """Who looks after the data."""
    operating_agency: ListPart = _text("Operating agency", 200)
    """The institution that operates the robot; must be named."""
    owner: ListPart = _text("Owner", 200)
    """The institution that owns it, where it is another."""
    naming_authority: str = _text("Naming authority")
    """Who gives names to data sets, such as a domain in reverse."""
    project: str = _text("Project")
    """For which the robot was deployed."""
    program: str = _text("Programme")
    """Of which the project is a part."""
    keywords: str = _text("Keywords", 500)
    """With commas between."""
    doi: str = _text("DOI")
    """Of the data set, where it has one."""
    acknowledgement: str = _text("Acknowledgement", 1000)
    """Whom users of the data should thank."""
    sensors: dict[str, Sensor] = Field(default_factory=dict, title="Sensors")
    """By the key of the channel that each measures."""
    license: Literal["", "CC-BY-4.0", "CC0-1.0", "CC-BY-SA-4.0", "CC-BY-NC-4.0"] = Field(
        default="", title="Licence"
    )
    """Under which the data may be used; must be chosen."""

    def missing(self) -> list[tuple[str, str]]:
        """Return each field that a file cannot do without and that is empty, with its title."""
        person = self.principal_investigator
        needed = {
            "principal_investigator.name": (person.name, "Principal investigator, name"),
            "principal_investigator.email": (person.email, "Principal investigator, e-mail"),
            "operating_agency": (self.operating_agency, "Operating agency"),
            "license": (self.license, "Licence"),
        }
        return [(path, title) for path, (value, title) in needed.items() if not value.strip()]

    def contributors(self) -> list[tuple[Contributor, str]]:
        """Return the people who are named, with their roles; the principal investigator first."""
        all_people = (
            (self.principal_investigator, "principal investigator"),
            (self.operator, "operator"),
            (self.data_manager, "data manager"),
        )
        return [(person, role) for person, role in all_people if person.name.strip()]

    def institutions(self) -> list[tuple[str, str]]:
        """Return the institutions that are named, with their roles."""
        both = ((self.operating_agency, "operating agency"), (self.owner, "owner"))
        return [(name, role) for name, role in both if name.strip()]
