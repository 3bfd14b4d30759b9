"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.event_bus import ChannelsChanged, JobChanged
from server.base.foundation import Foundation
from server.system import (
    channel_route,
    configuration_route,
    docs_route,
    event_route,
    health_route,
    job_route,
    live_route,
)
from server.system.certificate import ServedCertificate
from server.system.rows_aside import watch_rows_aside

ROUTERS = (
    health_route.router,
    configuration_route.router,
    channel_route.router,
    event_route.router,
    job_route.router,
    live_route.router,
    docs_route.router,
)


def install(foundation: Foundation) -> None:
    """Show jobs and changes of channels in the live stream; watch certificate and stray rows."""
    feed, settings = foundation.feed, foundation.settings
    foundation.services.add(feed)

    async def robot_of_job(job: str) -> tuple[str, ...]:
        robot = (await foundation.jobs.get(job)).robot
        return () if robot is None else (robot,)

    subjects = foundation.services.get(Subjects)
    subjects.add("job", robot_of_job)
    subjects.add_details("key", "kind", "version")
    foundation.bus.subscribe(ChannelsChanged, lambda _: feed.mark("channels"))
    foundation.bus.subscribe(
        JobChanged, lambda event: feed.put("jobs", event.job.id, lambda: event.job, event.job.robot)
    )
    foundation.lifetime.run(
        "rows aside", lambda: watch_rows_aside(settings.data_dir, foundation.alarms)
    )
    if settings.tls_certificate is not None and settings.tls_key is not None:
        certificate = ServedCertificate(settings.tls_certificate, settings.tls_key)
        foundation.services.add(certificate)
        foundation.lifetime.run("certificate", lambda: certificate.watch(foundation.alarms))
