"""The 3D scene: water body, robots, tracks, plans and maps in viser."""
