"""What is known of each robot right now; nobody else changes it.

Publishes ``RobotChanged``, ``RobotReported``, ``FixTaken`` and ``LinkSwitched``
(``server.fleet.event``).
"""
