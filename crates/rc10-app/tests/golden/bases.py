"""Bases by numpy in f64: rim speeds from the geometry of each contact, motions by lstsq.

Nothing here is solved as rc10-app does. A wheel's rim speed comes from its contact: the velocity of
the wheel's centre is the rim's, plus a rolling of the roller, and those two are unknowns. A base with
plain wheels moves in the null space of their sideways speed, found by SVD.

The wheels stand side by side in a row; missing ones are empty. `rollers` is empty for a plain wheel.
"""

import sys

import numpy as np

SEED = 5
WHEELS = 6
F = np.float32


def direction(degrees):
    a = np.radians(float(degrees))
    return np.array([np.cos(a), np.sin(a)])


def across(v):
    return np.array([-v[1], v[0]])


def center_velocity(wheel, twist):
    x, y = float(wheel["x"]), float(wheel["y"])
    vx, vy, wz = twist
    return np.array([vx - wz * y, vy + wz * x])


def rim_speed(wheel, twist):
    """Speed of the rim where it touches, for the way in which the motor turns forward."""
    d = direction(wheel["direction"])
    v = center_velocity(wheel, twist)
    if wheel["rollers"] is None:
        speed = v @ d
    else:
        axis = direction(float(wheel["direction"]) + 90.0 + float(wheel["rollers"]))
        rolling = across(axis)
        speed = np.linalg.solve(np.column_stack([d, rolling]), v)[0]
    return -speed if wheel["reversed"] else speed


def matrices(wheels):
    unit = np.eye(3)
    rows = np.array([[rim_speed(w, unit[k]) for k in range(3)] for w in wheels])
    plain = [w for w in wheels if w["rollers"] is None]
    if not plain:
        return rows, None
    e = across(direction(plain[0]["direction"]))
    # The middle of the plain wheels does not move along their axles.
    side = np.mean([[center_velocity(w, unit[k]) @ e for k in range(3)] for w in plain], axis=0)
    return rows, side


def motions(side):
    """A basis of the motions that the base can do."""
    if side is None:
        return np.eye(3)
    return np.linalg.svd(side.reshape(1, 3))[2][1:].T


def wheel(x, y, way, rollers, radius, is_reversed=False):
    return {
        "x": F(x),
        "y": F(y),
        "direction": F(way),
        "rollers": None if rollers is None else F(rollers),
        "radius": F(radius),
        "reversed": is_reversed,
    }


def mecanum(r, x, y):
    return [
        wheel(x, y, 0, 45, r),
        wheel(x, -y, 0, -45, r),
        wheel(-x, y, 0, -45, r),
        wheel(-x, -y, 0, 45, r),
    ]


def ring(r, distance, n, first):
    wheels = []
    for k in range(n):
        angle = first + 360.0 * k / n
        x, y = distance * direction(angle)
        wheels.append(wheel(x, y, angle + 90, 90, r))
    return wheels


def parallel(r, places):
    return [wheel(x, y, 0, None, r) for x, y in places]


def random_wheels(rng, n, plain):
    along = rng.uniform(-180, 180)
    wheels = []
    for k in range(n):
        x, y = rng.uniform(-0.4, 0.4, 2)
        radius = rng.uniform(0.03, 0.09)
        if k < plain:
            wheels.append(wheel(x, y, along, None, radius, rng.random() < 0.3))
        else:
            rollers = rng.choice([90.0, 45.0, -45.0, 60.0])
            way = rng.uniform(-180, 180)
            wheels.append(wheel(x, y, way, rollers, radius, rng.random() < 0.3))
    return wheels


def is_good(wheels):
    rows, side = matrices(wheels)
    return np.linalg.cond(rows @ motions(side)) < 30


def bases(rng):
    for _ in range(8):
        r, a, b = rng.uniform(0.03, 0.1), rng.uniform(0.1, 0.4), rng.uniform(0.1, 0.4)
        yield "mecanum", mecanum(r, a, b)
        yield "omni_3", ring(r, a, 3, 60.0)
        yield "omni_4", ring(r, a, 4, 45.0)
        yield "differential", parallel(r, [(0, b), (0, -b)])
        yield "skid_steer", parallel(r, [(a, b), (a, -b), (-a, b), (-a, -b)])
    for count in range(60):
        n, plain = 3 + count % 4, (0, 0, 2)[count % 3]
        wheels = random_wheels(rng, n, plain)
        while not is_good(wheels):
            wheels = random_wheels(rng, n, plain)
        yield "list", wheels


def number(x):
    return "" if x is None else "%.9g" % x


def padded(values, each=1):
    return [number(v) for v in values] + [""] * (each * WHEELS - len(values))


def main():
    rng = np.random.default_rng(SEED)
    names = ["x", "y", "direction", "rollers", "radius", "reversed"]
    header = ["kind", "count", "vx", "vy", "wz", "sideways"]
    header += [f"{name}{k}" for k in range(WHEELS) for name in names]
    header += [f"speed{k}" for k in range(WHEELS)] + [f"measured{k}" for k in range(WHEELS)]
    header += ["mx", "my", "mwz"] + [f"residual{k}" for k in range(WHEELS)]
    csv = [",".join(header)]
    for kind, wheels in bases(rng):
        n = len(wheels)
        rows, side = matrices(wheels)
        twist = np.array([F(v) for v in rng.uniform(-1, 1, 3) * [2, 2, 5]], dtype=float)
        done, sideways = twist, 0.0
        if side is not None:
            plain = next(w for w in wheels if w["rollers"] is None)
            e = across(direction(plain["direction"]))
            sideways = side @ twist
            # Takes the sideways speed away by moving sideways, so that it still turns as told.
            done = twist - np.array([e[0], e[1], 0.0]) * (sideways / (side[:2] @ e))
        rpm = np.array([60.0 / (2 * np.pi * float(w["radius"])) for w in wheels])
        speeds = rows @ done * rpm
        measured = np.array([F(v) for v in speeds + rng.normal(0, 30, n)], dtype=float)
        basis = motions(side)
        rims = measured / rpm
        motion = basis @ np.linalg.lstsq(rows @ basis, rims, rcond=None)[0]
        residual = rims - rows @ motion
        cells = [kind, str(n)] + [number(v) for v in [*twist, sideways]]
        flat = [w[name] if name != "reversed" else int(w[name]) for w in wheels for name in names]
        cells += padded(flat, len(names)) + padded(speeds) + padded(measured)
        cells += [number(v) for v in motion] + padded(residual)
        csv.append(",".join(cells))
    sys.stdout.write("\n".join(csv) + "\n")


if __name__ == "__main__":
    main()
