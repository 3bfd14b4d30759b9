"""What flights leave behind: imports, exports, journals, and replays of them.

Publishes nothing.
"""
