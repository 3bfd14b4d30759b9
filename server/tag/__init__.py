"""Tags of animals that robots hear: listed, imported, exported, and where a resting tag is.

Asks ``server.link`` what robots heard and ``server.map`` what the water was like there.
"""
