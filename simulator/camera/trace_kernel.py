"""Compiled ray tracing: from a pixel backwards through the surface to what it shows.

Light is linear, 1 is what saturates the sensor. Whatever is drawn has two parts: its mean light
(*base*), and how much of that the caustic net changes (*swing*). ``simulator.camera.reference`` has
the same in its readable form.
"""

import math

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray, IntArray
from autonomy.compiled import inlined_kernel, inner_kernel, kernel
from autonomy.vision.refraction_kernel import refracted

Light = npt.NDArray[np.float32]
Places = npt.NDArray[np.int32]
Cells = npt.NDArray[np.uint8]

# fmt: off
(NORTH_MIN, NORTH_MAX, EAST_MIN, EAST_MAX, FLOOR, LEVEL, RIM, RIM_WIDTH, AIR_TO_WATER,
 GRADIENT_NORTH, GRADIENT_EAST, HAZE, HAZE_LIGHT, LAMP_NORTH, LAMP_EAST, LAMP_DOWN, GLARE,
 GLARE_WIDTH, FLOOR_SHADE, WALL_SHADE, RIM_SHADE, GROUND_SHADE, WHITE, BLACK, BACK) = range(25)
WORLD_SIZE = 25
ORIGIN, ACROSS, DOWN, NORMAL, COLUMNS, ROWS, FIRST_CELL, PLAIN, MEDIUM = (
 0, 3, 6, 9, 12, 13, 14, 15, 16)
PANEL_SIZE = 17
ONE_END, OTHER_END, RADIUS, HULL_SHADE, HULL_MEDIUM = 0, 3, 6, 7, 8
HULL_SIZE = 9
WAVE_NORTH, WAVE_EAST, WAVE_PHASE, SLOPE_NORTH, SLOPE_EAST = range(5)
# fmt: on
"""Numbers of a packed world, a panel (plate, wing, board), a hull (a capsule) and a ripple."""
IN_AIR, IN_WATER = 1.0, 2.0
EVERYWHERE = IN_AIR + IN_WATER
"""Where something is: only in air, only in water, or it may be in both."""
SLOTS = 9
"""Moments of the exposure, one for each of the 3 x 3 parts of a pixel."""
TILE = 256
"""Texels along a side of the caustic net, which repeats."""
TILE_M = 1.6
"""Its side, m."""
CAUSTIC_DEPTH_M = 0.3
"""Depth below which caustics have their full strength."""
_UNSEEN = np.float32(-1.0)
_MOMENTS = np.array([[1, 6, 5], [8, 4, 0], [3, 2, 7]])
"""A magic square: no row and no column of a pixel's parts is seen earlier than another."""


@inlined_kernel
def _panel_hit(
    panels: FloatArray,
    s: int,
    i: int,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    most: float,
) -> tuple[float, float, float, float]:
    """Return where a ray meets a panel: distance (infinite if not), column, row, and the side.

    The side is positive for the front.
    """
    nx, ny, nz = panels[s, i, NORMAL], panels[s, i, NORMAL + 1], panels[s, i, NORMAL + 2]
    side = nx * dx + ny * dy + nz * dz
    x, y, z = panels[s, i, ORIGIN] - x, panels[s, i, ORIGIN + 1] - y, panels[s, i, ORIGIN + 2] - z
    t = (nx * x + ny * y + nz * z) / side if side != 0.0 else math.inf
    if not 0.0 < t < most:
        return math.inf, 0.0, 0.0, 0.0
    x, y, z = t * dx - x, t * dy - y, t * dz - z
    column = panels[s, i, ACROSS] * x + panels[s, i, ACROSS + 1] * y + panels[s, i, ACROSS + 2] * z
    row = panels[s, i, DOWN] * x + panels[s, i, DOWN + 1] * y + panels[s, i, DOWN + 2] * z
    if not (0.0 <= column < panels[s, i, COLUMNS] and 0.0 <= row < panels[s, i, ROWS]):
        return math.inf, 0.0, 0.0, 0.0
    return t, column, row, side


@inlined_kernel
def _hull_hit(
    hulls: FloatArray,
    s: int,
    i: int,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    most: float,
) -> float:
    """Return where a ray meets a capsule, infinite if it does not: cylinder, then both ends."""
    ax, ay, az = hulls[s, i, 0], hulls[s, i, 1], hulls[s, i, 2]
    ox, oy, oz = x - hulls[s, i, 3], y - hulls[s, i, 4], z - hulls[s, i, 5]
    bx, by, bz = hulls[s, i, 3] - ax, hulls[s, i, 4] - ay, hulls[s, i, 5] - az
    radius = hulls[s, i, RADIUS]
    ax, ay, az = x - ax, y - ay, z - az
    bb, bd = bx * bx + by * by + bz * bz, bx * dx + by * dy + bz * dz
    bo, do = bx * ax + by * ay + bz * az, dx * ax + dy * ay + dz * az
    oo, r2 = ax * ax + ay * ay + az * az, radius * radius
    a, b, c = bb - bd * bd, bb * do - bo * bd, bb * oo - bo * bo - r2 * bb
    inner = b * b - a * c
    if inner < 0.0:
        return math.inf
    t = (-b - math.sqrt(inner)) / max(a, 1e-12)
    along = bo + t * bd
    if not 0.0 < along < bb:
        if along > 0.0:  # the other end
            do, oo = dx * ox + dy * oy + dz * oz, ox * ox + oy * oy + oz * oz
        inner = do * do - oo + r2
        if inner < 0.0:
            return math.inf
        t = -do - math.sqrt(inner)
    return t if 0.0 < t < most else math.inf


@inlined_kernel
def _object_hit(
    world: FloatArray,
    panels: FloatArray,
    hulls: FloatArray,
    s: int,
    medium: float,
    near: IntArray,
    near_panels: int,
    near_all: int,
    cells: Cells,
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    most: float,
) -> tuple[float, float]:
    """Return the nearest object on a way: distance (infinite if there is none), and its shade."""
    nearest, shade = math.inf, 0.0
    for k in range(near_panels):
        i = near[k]
        if panels[s, i, MEDIUM] + medium == EVERYWHERE:  # it is in the other medium only
            continue
        t, column, row, side = _panel_hit(panels, s, i, x, y, z, dx, dy, dz, most)
        if t < nearest:
            nearest, most = t, t
            if panels[s, i, FIRST_CELL] < 0.0:
                shade = panels[s, i, PLAIN]
            elif side < 0.0:
                shade = world[BACK]
            else:
                cell = int(panels[s, i, FIRST_CELL]) + int(row) * int(panels[s, i, COLUMNS])
                shade = world[WHITE] if cells[cell + int(column)] > 0 else world[BLACK]
    for k in range(near_panels, near_all):
        i = near[k]
        if hulls[s, i, HULL_MEDIUM] + medium == EVERYWHERE:
            continue
        t = _hull_hit(hulls, s, i, x, y, z, dx, dy, dz, most)
        if t < nearest:
            nearest, most, shade = t, t, hulls[s, i, HULL_SHADE]
    return nearest, shade


@inlined_kernel
def _light_at(world: FloatArray, north: float, east: float) -> float:
    """Return the light that falls on a place."""
    middle_n = 0.5 * (world[NORTH_MIN] + world[NORTH_MAX])
    middle_e = 0.5 * (world[EAST_MIN] + world[EAST_MAX])
    sloped = world[GRADIENT_NORTH] * (north - middle_n) + world[GRADIENT_EAST] * (east - middle_e)
    return max(1.0 + sloped, 0.05)


@inlined_kernel
def _glare(world: FloatArray, eye: FloatArray, dx: float, dy: float, dz: float) -> float:
    """Return the light of the lamp in the surface: by how much that had to tilt to mirror it."""
    if not (world[GLARE] > 0.0 and dz > 1e-6):
        return 0.0
    t = (world[LEVEL] - eye[2]) / dz
    ln, le = world[LAMP_NORTH] - eye[0] - t * dx, world[LAMP_EAST] - eye[1] - t * dy
    ld = world[LAMP_DOWN] - world[LEVEL]
    length = math.sqrt(ln * ln + le * le + ld * ld)
    north, east, down = ln - length * dx, le - length * dy, ld - length * dz
    off2, width2 = north * north + east * east, (down * world[GLARE_WIDTH]) ** 2
    return world[GLARE] * math.exp(-0.5 * off2 / width2) if off2 < 40.0 * width2 else 0.0


@inlined_kernel
def _is_between_walls(world: FloatArray, x: float, y: float, more: float) -> bool:
    """Tell whether a place lies in the tank seen from above, or so little outside of it."""
    return (
        world[NORTH_MIN] - more < x < world[NORTH_MAX] + more
        and world[EAST_MIN] - more < y < world[EAST_MAX] + more
    )


@inlined_kernel
def _dry_end(
    world: FloatArray, eye: FloatArray, dx: float, dy: float, per_down: float
) -> tuple[float, float]:
    """Return where a ray ends in air, and the shade there; a negative shade is the water.

    ``dx`` and ``dy`` are those of the ray, and ``per_down`` is 1 over how much it goes down.
    """
    down = (world[LEVEL] - eye[2]) * per_down
    is_inside = _is_between_walls(world, eye[0], eye[1], 0.0)
    if is_inside and _is_between_walls(world, eye[0] + down * dx, eye[1] + down * dy, 0.0):
        return down, -1.0
    t = (-world[RIM] - eye[2]) * per_down
    x, y = eye[0] + t * dx, eye[1] + t * dy
    if _is_between_walls(world, x, y, 0.0):
        wall = t + _wall(world, x, y, dx, dy)
        return (wall, world[WALL_SHADE]) if wall < down else (down, -1.0)
    if _is_between_walls(world, x, y, world[RIM_WIDTH]):
        return t, world[RIM_SHADE]
    return (world[FLOOR] - eye[2]) * per_down, world[GROUND_SHADE]


@inlined_kernel
def _wall(world: FloatArray, x: float, y: float, dx: float, dy: float) -> float:
    """Return where a ray that begins between the walls meets one."""
    t = math.inf
    if dx != 0.0:
        t = ((world[NORTH_MAX] if dx > 0.0 else world[NORTH_MIN]) - x) / dx
    if dy != 0.0:
        t = min(t, ((world[EAST_MAX] if dy > 0.0 else world[EAST_MIN]) - y) / dy)
    return t


@inlined_kernel
def _sample(
    world: FloatArray,
    eye: FloatArray,
    dx: float,
    dy: float,
    dz: float,
    slope_north: float,
    slope_east: float,
    glare: float,
    panels: FloatArray,
    hulls: FloatArray,
    s: int,
    near: IntArray,
    near_panels: int,
    near_all: int,
    cells: Cells,
) -> tuple[float, float, float, float, float]:
    """Return what a ray shows: base, swing, shade, and the place north and east."""
    if not dz > 1e-6:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    end, ground = _dry_end(world, eye, dx, dy, 1.0 / dz)
    t, shade = _object_hit(
        world, panels, hulls, s, IN_AIR, near, near_panels, near_all, cells,
        eye[0], eye[1], eye[2], dx, dy, dz, end,
    )  # fmt: skip
    if t < math.inf or ground >= 0.0:
        if not t < math.inf:
            t, shade = end, ground
        x, y = eye[0] + t * dx, eye[1] + t * dy
        return shade * _light_at(world, x, y), 0.0, shade, x, y
    x, y, z = eye[0] + end * dx, eye[1] + end * dy, world[LEVEL]
    nx, ny, nz = 0.0, 0.0, 1.0
    if slope_north != 0.0 or slope_east != 0.0:
        nz = 1.0 / math.sqrt(1.0 + slope_north * slope_north + slope_east * slope_east)
        nx, ny = -slope_north * nz, -slope_east * nz
    wx, wy, wz = refracted(dx, dy, dz, nx, ny, nz, world[AIR_TO_WATER])
    end, ground = (world[FLOOR] - z) / wz, world[FLOOR_SHADE]
    if not _is_between_walls(world, x + end * wx, y + end * wy, 0.0):
        end, ground = _wall(world, x, y, wx, wy), world[WALL_SHADE]
    t, shade = _object_hit(
        world, panels, hulls, s, IN_WATER, near, near_panels, near_all, cells,
        x, y, z, wx, wy, wz, end,
    )  # fmt: skip
    if not t < math.inf:
        t, shade = end, ground
    x, y, depth = x + t * wx, y + t * wy, t * wz
    clear = math.exp(-world[HAZE] * t)
    direct = shade * _light_at(world, x, y) * clear
    base = direct + world[HAZE_LIGHT] * (1.0 - clear) + glare
    return base, direct * min(depth * (1.0 / CAUSTIC_DEPTH_M), 1.0), shade, x, y


@inner_kernel
def _slope_at(
    waves: FloatArray, eye: FloatArray, level: float, dx: float, dy: float, dz: float
) -> tuple[float, float]:
    """Return the slope of the surface where a ray meets it."""
    north, east = 0.0, 0.0
    if len(waves) == 0 or not dz > 1e-6:
        return north, east
    t = (level - eye[2]) / dz
    x, y = eye[0] + t * dx, eye[1] + t * dy
    for i in range(len(waves)):
        c = math.cos(waves[i, WAVE_NORTH] * x + waves[i, WAVE_EAST] * y + waves[i, WAVE_PHASE])
        north += waves[i, SLOPE_NORTH] * c
        east += waves[i, SLOPE_EAST] * c
    return north, east


@inlined_kernel
def _texel(north: float, east: float) -> int:
    """Return which texel of the caustic net lies over a place."""
    scale = TILE / TILE_M
    row = math.floor(north * scale) & (TILE - 1)
    return row * TILE + (math.floor(east * scale) & (TILE - 1))


@inner_kernel
def _are_near(
    boxes: IntArray, count: int, row: int, column: int, near: IntArray, begin: int
) -> int:
    """Add the objects whose box holds a pixel; return how many there are now."""
    for i in range(count):
        if boxes[i, 0] <= row < boxes[i, 1] and boxes[i, 2] <= column < boxes[i, 3]:
            near[begin] = i
            begin += 1
    return begin


@inlined_kernel
def _has_print(panels: FloatArray, near: IntArray, near_panels: int) -> bool:
    """Tell whether one of the panels near a pixel has a pattern."""
    for k in range(near_panels):  # noqa: SIM110 - numba knows no any()
        if panels[0, near[k], FIRST_CELL] >= 0.0:
            return True
    return False


@inlined_kernel
def _is_plain(shades: Light, i: int, j: int, reach: int) -> bool:
    """Tell whether all around a pixel has its shade, as far as it was traced."""
    own = shades[i, j]
    for k in range(max(i - reach, 0), min(i + reach + 1, shades.shape[0])):
        for m in range(max(j - reach, 0), min(j + reach + 1, shades.shape[1])):
            if shades[k, m] != own and shades[k, m] != _UNSEEN:
                return False
    return True


@kernel
def trace(
    corner: IntArray,
    rays: Light,
    eye: FloatArray,
    world: FloatArray,
    waves: FloatArray,
    panels: FloatArray,
    panel_boxes: IntArray,
    hulls: FloatArray,
    hull_boxes: IntArray,
    cells: Cells,
    reach: int,
    is_still: bool,
    base: Light,
    swing: Light,
    place: Places,
) -> None:
    """Trace a rectangle of a picture.

    Each pixel is traced once; near a print it is traced in 3 x 3 parts where those around it have
    another shade.

    Args:
        corner: First row and column of the rectangle, shape ``(2,)``.
        rays: Along which each pixel looks, in NED, with one pixel more on each side of the picture,
            shape ``(rows + 2, columns + 2, 3)``.
        eye: Place of the camera in NED, shape ``(3,)``, m.
        world: Packed water, light and shades, shape ``(25,)``.
        waves: Ripples of this moment, shape ``(w, 5)``.
        panels: At each moment of the exposure, shape ``(9, n, 17)``.
        panel_boxes: First and last row, first and last column that may show each (the last is
            not among them), shape ``(n, 4)``.
        hulls: At each moment, shape ``(9, m, 9)``.
        hull_boxes: As of the panels, shape ``(m, 4)``.
        cells: Patterns of all panels, one after the other: white or not.
        reach: Pixels around one within which another shade splits it: so far a pixel goes from its
            middle, with half of the way that things go during the exposure.
        is_still: Whether pixels that show no object are left as they are.
        base: Takes the mean light of the rectangle, shape ``(h, w)``.
        swing: Takes how much of it the caustics change, shape ``(h, w)``.
        place: Takes the texel of the caustic net over what is seen, shape ``(h, w)``.
    """
    count_panels, count_hulls = len(panel_boxes), len(hull_boxes)
    near = np.empty(count_panels + count_hulls, dtype=np.int64)
    shades = np.full(base.shape, _UNSEEN)
    for phase in range(2):
        parts = SLOTS if phase == 1 else 1
        for i in range(base.shape[0]):
            row = corner[0] + i
            for j in range(base.shape[1]):
                if phase == 1 and (shades[i, j] == _UNSEEN or _is_plain(shades, i, j, reach)):
                    continue
                column = corner[1] + j
                n_panels = _are_near(panel_boxes, count_panels, row, column, near, 0)
                n_all = _are_near(hull_boxes, count_hulls, row, column, near, n_panels)
                if is_still and n_all == 0:
                    continue
                if phase == 1 and not _has_print(panels, near, n_panels):
                    continue
                r, c = row + 1, column + 1
                dx, dy, dz = float(rays[r, c, 0]), float(rays[r, c, 1]), float(rays[r, c, 2])
                sn, se = _slope_at(waves, eye, world[LEVEL], dx, dy, dz)
                glare = _glare(world, eye, dx, dy, dz)
                light, change, s = 0.0, 0.0, SLOTS // 2
                for part in range(parts):
                    px, py, pz = dx, dy, dz
                    if phase == 1:
                        a, b = part // 3, part % 3
                        va, ub = (3 * a - b - 2) / 18.0, (a + 3 * b - 4) / 18.0
                        px += va * (rays[r + 1, c, 0] - rays[r - 1, c, 0])
                        py += va * (rays[r + 1, c, 1] - rays[r - 1, c, 1])
                        pz += va * (rays[r + 1, c, 2] - rays[r - 1, c, 2])
                        px += ub * (rays[r, c + 1, 0] - rays[r, c - 1, 0])
                        py += ub * (rays[r, c + 1, 1] - rays[r, c - 1, 1])
                        pz += ub * (rays[r, c + 1, 2] - rays[r, c - 1, 2])
                        s = _MOMENTS[a, b]
                    one, other, shade, x, y = _sample(
                        world, eye, px, py, pz, sn, se, glare, panels, hulls, s, near, n_panels,
                        n_all, cells,
                    )  # fmt: skip
                    light += one
                    change += other
                    if phase == 0:
                        place[i, j], shades[i, j] = _texel(x, y), shade
                base[i, j], swing[i, j] = light / parts, change / parts


@kernel
def blur(sharp: Light, weights: Light, top: int, left: int, rows: Light, into: Light) -> None:
    """Blur a rectangle and write its inner part into a picture.

    Args:
        sharp: The rectangle, shape ``(h, w)``; beyond its border it goes on as it ends.
        weights: Of the middle and of one side, shape ``(r + 1,)``; add up to 1 over both sides.
        top: Rows of the rectangle above its inner part.
        left: Columns before it.
        rows: Scratch of the rectangle's shape.
        into: Takes the inner part.
    """
    h, w = sharp.shape
    reach = len(weights) - 1
    for i in range(h):
        for j in range(into.shape[1]):
            at = left + j
            total = weights[0] * sharp[i, at]
            for k in range(1, reach + 1):
                total += weights[k] * (sharp[i, max(at - k, 0)] + sharp[i, min(at + k, w - 1)])
            rows[i, j] = total
    for i in range(into.shape[0]):
        at = top + i
        for j in range(into.shape[1]):
            total = weights[0] * rows[at, j]
            for k in range(1, reach + 1):
                total += weights[k] * (rows[max(at - k, 0), j] + rows[min(at + k, h - 1), j])
            into[i, j] = total


@kernel
def develop(
    base: Light,
    swing: Light,
    place: Places,
    net: Light,
    shifts: IntArray,
    gain: float,
    noise: Light,
    starts: IntArray,
    shot: float,
    read: float,
    greys: Cells,
    picture: Cells,
) -> None:
    """Turn light into grey values: caustics, noise of photons and of reading, the camera's curve.

    Args:
        base: Mean light, shape ``(rows, columns)``.
        swing: How much of it the caustics change.
        place: Texel of the caustic net over each pixel.
        net: Caustics around their mean, two layers of which add up, shape ``(256 * 256,)``.
        shifts: Rows and columns by which each layer has moved, shape ``(2, 2)``, texels.
        gain: Grows all light.
        noise: Normal numbers, shape ``(n,)``.
        starts: Where in it each row begins, shape ``(rows,)``, below ``n - columns``.
        shot: Variance of the noise per light.
        read: Standard deviation of the reading noise.
        greys: Grey value of each light from 0 to 1, shape ``(k,)``.
        picture: Takes the grey values.
    """
    top = len(greys) - 1
    first, second = shifts[0, 0] * TILE, shifts[1, 0] * TILE
    most, width = TILE * TILE - 1, TILE - 1
    read2 = np.float32(read * read)
    for i in range(base.shape[0]):
        start = starts[i]
        for j in range(base.shape[1]):
            at = place[i, j]
            one = ((at + first) & (most - width)) | ((at + shifts[0, 1]) & width)
            other = ((at + second) & (most - width)) | ((at + shifts[1, 1]) & width)
            light = gain * (base[i, j] + swing[i, j] * (net[one] + net[other]))
            light += math.sqrt(read2 + shot * max(light, 0.0)) * noise[start + j]
            picture[i, j] = greys[int(min(max(light, 0.0), 1.0) * top + 0.5)]


def warm_up() -> None:
    """Compile every kernel of this module with the argument types of real use."""
    light = np.zeros((4, 4), dtype=np.float32)
    place, picture = np.zeros((4, 4), dtype=np.int32), np.zeros((4, 4), dtype=np.uint8)
    none, ints = np.zeros((0, 4), dtype=np.int64), np.zeros((4, 2), dtype=np.int64)
    trace(
        ints[0], np.ones((6, 6, 3), dtype=np.float32), np.zeros(3), np.ones(WORLD_SIZE),
        np.zeros((0, 5)), np.zeros((SLOTS, 0, PANEL_SIZE)), none, np.zeros((SLOTS, 0, HULL_SIZE)),
        none, picture[0], 1, False, light, light.copy(), place,
    )  # fmt: skip
    blur(light, light[0, :2], 0, 0, light.copy(), light.copy())
    net, greys = np.zeros(TILE * TILE, dtype=np.float32), np.zeros(16, dtype=np.uint8)
    develop(
        light, light, place, net, ints[:2], 1.0, light[0], np.zeros(4, dtype=np.int64), 0.0, 0.0,
        greys, picture,
    )  # fmt: skip
