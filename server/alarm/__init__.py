"""Rules that raise and clear alarms about robots.

Publishes nothing of its own; the alarm board tells ``AlarmChanged``.
"""
