"""The least time for paths of a base: dynamic programming on a fine grid, in f64.

Prints one line per path: the base, the limits, six waypoints, the path's length and least time.
The geometry is sampled densely and its derivatives are written down anew; the speeds come from
bisection on a grid 50 times as fine as that of rc10-app (24 cells a leg), where every limit holds at
the grid's points. Nothing is left out: also speeds at which the base must accelerate, lest its yaw
rate change too fast.
"""

import numpy as np

PER_LEG = 24 * 50


def mecanum(radius, half_wheelbase, half_track):
    arm = half_wheelbase + half_track
    rows = np.array([[1, -1, -arm], [1, 1, arm], [1, 1, -arm], [1, -1, arm]])
    return rows / radius * 30 / np.pi


def omni(count, first, radius, distance):
    angles = np.radians(first + 360 / count * np.arange(count))
    rows = np.column_stack([-np.sin(angles), np.cos(angles), np.full(count, distance)])
    return rows / radius * 30 / np.pi


BASES = {
    "mecanum": mecanum(0.076, 0.20, 0.25),
    "omni_4": omni(4, 45, 0.076, 0.25),
    "omni_3": omni(3, 60, 0.05, 0.2),
}
WHEEL_LIMIT = 450.0


def legs_of(points, radii):
    """For each leg a list of pieces: start, direction, curvature, length."""
    count = len(points)
    directions = np.diff(points, axis=0)
    lengths = np.hypot(*directions.T)
    angles = np.arctan2(directions[:, 1], directions[:, 0])
    turns = (np.diff(angles) + np.pi) % (2 * np.pi) - np.pi
    takes, arcs, bent = np.zeros(count), np.zeros(count), np.zeros(count)
    for at in range(1, count - 1):
        if radii[at] > 0:
            turn = turns[at - 1]
            takes[at] = radii[at] * np.tan(abs(turn) / 2)
            arcs[at] = radii[at] * abs(turn) / 2
            bent[at] = np.sign(turn) / radii[at]
    legs = []
    for leg in range(count - 1):
        pieces = []
        if arcs[leg] > 0:
            pieces.append((angles[leg] - turns[leg - 1] / 2, bent[leg], arcs[leg]))
        pieces.append((angles[leg], 0.0, lengths[leg] - takes[leg] - takes[leg + 1]))
        if arcs[leg + 1] > 0:
            pieces.append((angles[leg], bent[leg + 1], arcs[leg + 1]))
        legs.append(pieces)
    return legs, turns


def least_time(rows, points, headings, radii, caps, linear, angular, max_speed):
    legs, turns = legs_of(points, radii)
    lengths = np.array([sum(piece[2] for piece in leg) for leg in legs])
    steps = (np.diff(headings) + np.pi) % (2 * np.pi) - np.pi
    means = steps / lengths
    slopes = [means[0]]
    for before, after in zip(means, means[1:]):
        slopes.append(2 * before * after / (before + after) if before * after > 0 else 0.0)
    slopes.append(means[-1])

    # Per grid interval, at its start and its end: what the limits need.
    squares = []  # highest x at each point
    sections = []  # (length, curvature, (slope, bend) at start and end)
    heading = headings[0]
    for leg, pieces in enumerate(legs):
        length, mean = lengths[leg], means[leg]
        a, b = slopes[leg], slopes[leg + 1]
        square, cube = (3 * mean - 2 * a - b) / length, (a + b - 2 * mean) / length**2
        way = 0.0
        for angle, curvature, piece in pieces:
            cells = max(2, round(PER_LEG * piece / length))
            s = np.linspace(0, piece, cells + 1)
            at = way + s
            phi = angle + curvature * s - (heading + a * at + square * at**2 + cube * at**3)
            slope, bend = a + 2 * square * at + 3 * cube * at**2, 2 * square + 6 * cube * at
            motion = np.array([np.cos(phi), np.sin(phi), slope])
            cap = np.minimum(max_speed**2, (WHEEL_LIMIT / np.abs(rows @ motion).max(axis=0)) ** 2)
            if curvature != 0:
                cap = np.minimum(cap, linear / abs(curvature))
            cap = list(cap)
            if squares:
                squares[-1] = min(squares[-1], cap[0])
                cap = cap[1:]
            squares += cap
            for k in range(cells):
                sections.append(
                    (piece / cells, curvature, slope[k], bend[k], slope[k + 1], bend[k + 1])
                )
            way += piece
        heading += steps[leg]
        if leg + 1 < len(legs):
            corner = abs(turns[leg]) > 1e-3 and radii[leg + 1] == 0
            squares[-1] = min(squares[-1], 0.0 if corner else caps[leg + 1] ** 2)
    squares[0] = min(squares[0], 0.0)
    squares[-1] = 0.0

    def range_of(x, curvature, slope, bend):
        """Accelerations along the path that are allowed at a speed; empty if low > high."""
        left = linear**2 - (curvature * x) ** 2
        if left < 0:
            return 1.0, -1.0
        high = np.sqrt(left)
        low = -high
        if abs(slope) > 1e-12:
            one, other = (-angular - bend * x) / slope, (angular - bend * x) / slope
            low, high = max(low, min(one, other)), min(high, max(one, other))
        elif abs(bend * x) > angular:
            return 1.0, -1.0
        return low, high

    def bisect(good, high):
        if good(high):
            return high
        low = 0.0
        for _ in range(45):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if good(middle) else (low, middle)
        return low

    for k in range(len(sections) - 1, -1, -1):
        length, curvature, slope, bend, _, _ = sections[k]
        most = squares[k + 1]

        def can_go_on(x):
            low, high = range_of(x, curvature, slope, bend)
            return low <= high and x + 2 * length * low <= most and x + 2 * length * high >= 0

        squares[k] = bisect(can_go_on, squares[k])
    x, time = 0.0, 0.0
    for k, (length, curvature, slope, bend, _, _) in enumerate(sections):
        _, high = range_of(x, curvature, slope, bend)
        after = max(0.0, min(squares[k + 1], x + 2 * length * high))
        time += 2 * length / (np.sqrt(x) + np.sqrt(after))
        x = after
    return lengths.sum(), time


def main():
    random = np.random.default_rng(16)
    columns = ["base", "linear", "angular", "max_speed", "length", "time"]
    for at in range(5):
        columns += [f"{name}{at}" for name in ("x", "y", "heading", "radius", "cap")]
    print(",".join(columns))
    made = 0
    while made < 60:
        count = 5
        points = np.round(np.cumsum(random.uniform(-2.5, 2.5, (count, 2)), axis=0), 3)
        directions = np.diff(points, axis=0)
        lengths = np.hypot(*directions.T)
        if lengths.min() < 0.3:
            continue
        spread = [0.0, 0.5, 1.5, 3.0][made % 4]
        headings = np.round(np.cumsum(random.uniform(-spread, spread, count)), 3)
        radii = np.zeros(count)
        angles = np.arctan2(directions[:, 1], directions[:, 0])
        turns = np.abs((np.diff(angles) + np.pi) % (2 * np.pi) - np.pi)
        if turns.max() > 2.6 or turns.min() < 0.05:
            continue
        for at in range(1, count - 1):
            if random.uniform() < 0.8:
                room = 0.48 * min(lengths[at - 1], lengths[at]) / np.tan(turns[at - 1] / 2)
                radii[at] = round(min(room, 2.0) * random.uniform(0.2, 0.98), 3)
        caps = np.full(count, np.inf)
        if made % 5 == 0:
            caps[2] = round(random.uniform(0.0, 1.0), 2)
        name = list(BASES)[made % 3]
        linear = round(random.uniform(1.5, 5.0), 2)
        angular = round(random.uniform(4.0, 20.0), 2)
        max_speed = [np.inf, 1.2, 2.0][made // 3 % 3]
        length, time = least_time(
            BASES[name], points, headings, radii, caps, linear, angular, max_speed
        )
        numbers = [linear, angular, max_speed, length, time]
        for at in range(count):
            numbers += [*points[at], headings[at], radii[at], caps[at]]
        print(",".join([name] + [f"{number:.9g}" for number in numbers]))
        made += 1


main()
