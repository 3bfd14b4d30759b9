"""What a robot's checklists decide before its plans are started."""

from typing import Literal

from autonomy.configuration import Configuration, quantity


class ChecklistConfig(Configuration):
    """Whether a plan may be started while a checklist is not complete."""

    start: Literal["off", "told", "required"] = quantity("told", title="Before a start")
    """Off: no checklist is asked for. Told: an incomplete one is said where a plan is sent, which
    goes all the same. Required: starting is refused while a blocking item is open, unless a person
    overrules it with a reason."""
