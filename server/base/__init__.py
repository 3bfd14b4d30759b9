"""What every capability stands on: settings, problems, jobs, workers, the bus, the live stream.

Publishes ``SettingsChanged``, ``JobChanged``, ``AlarmChanged`` and ``EventLogged``
(``server.base.event_bus``).
"""
