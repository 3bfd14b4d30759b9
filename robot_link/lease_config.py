"""How long a station waits for whoever is in charge of a robot."""

from autonomy.configuration import Configuration, quantity


class LeaseConfig(Configuration):
    """When a robot goes to another pilot although the one in charge does not answer.

    Both are times of the wall, also where a demo's clock runs faster.
    """

    silent_s: float = quantity(
        300.0, "s", title="Silent after", ge=5.0, le=14400.0, display_unit="min"
    )
    """Whoever is in charge counts as silent once no page of theirs was open and they asked for
    nothing for so long. Another pilot can take charge then at once, and a request is granted by
    itself."""
    answer_s: float = quantity(
        900.0, "s", title="Request granted after", ge=5.0, le=86400.0, display_unit="min"
    )
    """A request that is not answered is granted by itself after so long, also while a page of
    whoever is in charge is open, if they did nothing since it was made: an open page is not a
    person."""
    other_stations: bool = quantity(False, title="Other ground stations may take it")
    """Another MAVLink ground station that asks for the robot by radio gets it at once while no
    person is in charge; without this it is refused then. A person in charge is always asked."""
