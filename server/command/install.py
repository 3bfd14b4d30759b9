"""Puts the capability together."""

from server.access.subject import Subjects
from server.base.foundation import Foundation
from server.command import route
from server.command.commands import Commands
from server.command.state import CommandChanged
from server.fleet.fleet import Fleet
from server.link.event import CommandReported, RadiosChanged
from server.link.radios import Radios
from server.satellite.satellite import Satellite

ROUTERS = (route.router,)


def install(foundation: Foundation) -> None:
    """Make what sends commands and follows their levels."""
    foundation.services.get(Subjects).add_stored("command")
    services = foundation.services
    commands = Commands(
        foundation,
        services.get(Fleet),
        services.get(Radios),
        services.get(Satellite),
    )
    services.add(commands)

    def show(event: CommandChanged) -> None:
        view = event.command
        foundation.feed.put("commands", view.id, lambda: view, view.robot)

    foundation.bus.subscribe(CommandChanged, show)
    foundation.changes.follow(CommandChanged, lambda event: event.command.id)
    foundation.bus.subscribe(CommandReported, lambda event: commands.take(event.report))
    foundation.bus.subscribe(
        RadiosChanged,
        lambda _: foundation.background.start("commands under way", commands.resume()),
    )
    foundation.lifetime.run("command reports", commands.run)
    foundation.lifetime.on_start(commands.resume)
