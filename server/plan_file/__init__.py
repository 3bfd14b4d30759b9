"""Missions in and out as files of other programs: QGroundControl, KML, GeoJSON, CSV."""
