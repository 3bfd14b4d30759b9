"""The smallest change of two inputs that meets one linear constraint within a box (thesis 4.13)."""

Pair = tuple[float, float]


def solve(n: Pair, g: Pair, b: float, low: Pair, high: Pair) -> tuple[float, float, bool]:
    """Return the point of a box closest to ``n`` with ``g . u >= b``, and whether there is one.

    By the conditions of optimality the solution is ``clip(n + lam g)`` with the smallest
    ``lam >= 0`` that meets the constraint. ``g . clip(n + lam g)`` never falls with ``lam`` and is
    linear between the at most four values at which a component enters or leaves its bounds: the
    first of them, ascending, that meets the constraint ends the piece on which ``lam`` is found.

    Args:
        n: The point to stay close to; may be outside of the box.
        g: Gradient of the constraint.
        b: What ``g . u`` must reach.
        low: Lower corner of the box.
        high: Upper corner of the box, not below the lower one.

    Returns:
        The two components and True, or ``n`` clipped to the box and False where no point of the
        box meets the constraint.
    """

    def at(lam: float) -> Pair:
        return (
            min(max(n[0] + lam * g[0], low[0]), high[0]),
            min(max(n[1] + lam * g[1], low[1]), high[1]),
        )

    def reached(u: Pair) -> float:
        return g[0] * u[0] + g[1] * u[1]

    u = at(0.0)
    if reached(u) >= b:
        return *u, True
    if reached(best_corner(n, g, low, high)) < b:
        return *u, False
    kinks = sorted(
        lam
        for i in (0, 1)
        if g[i] != 0.0
        for lam in ((low[i] - n[i]) / g[i], (high[i] - n[i]) / g[i])
        if lam > 0.0
    )
    begin = 0.0
    for end in kinks:
        before, after = reached(at(begin)), reached(at(end))
        if after >= b:
            lam = begin + (end - begin) * (b - before) / (after - before)
            return *at(lam), True
        begin = end
    return *best_corner(n, g, low, high), True  # met by the corner but for rounding


def best_corner(n: Pair, g: Pair, low: Pair, high: Pair) -> Pair:
    """Return the corner of the box where ``g . u`` is greatest.

    A component that does not matter to ``g . u`` is that of ``n``, clipped.
    """
    corner = [min(max(n[i], low[i]), high[i]) for i in (0, 1)]
    for i in (0, 1):
        if g[i] > 0.0:
            corner[i] = high[i]
        elif g[i] < 0.0:
            corner[i] = low[i]
    return corner[0], corner[1]
