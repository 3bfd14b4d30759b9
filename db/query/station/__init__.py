"""What the station keeps of itself: events, alarms, jobs, people and settings."""
