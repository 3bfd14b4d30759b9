"""Charts and pictures under every map: tiles from files that lie beside the station.

Publishes nothing.
"""
