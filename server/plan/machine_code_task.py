"""Compiles every numeric kernel in a working process."""

from collections.abc import Callable

from autonomy import warm_up


def run(payload: None, report: Callable[[str], None], is_cancelled: Callable[[], bool]) -> None:
    """Go through all steps, report each that is done, and note when all are."""
    del payload
    digest = warm_up.source_digest()
    done = warm_up.FLIGHT if warm_up.is_complete(flight_only=True) else ()
    for step in warm_up.STEPS:
        if is_cancelled():
            return
        if step not in done:
            warm_up.compile_step(step)
        report(step)
    warm_up.note_complete(digest)
