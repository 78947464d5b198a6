"""Swerve bases by numpy in f64: each module's angle by trying all, motions by lstsq over 2 N rows."""

import sys

import numpy as np

SEED = 6
MODULES = 4
F = np.float32


def velocity(place, twist):
    return np.array([twist[0] - twist[2] * place[1], twist[1] + twist[2] * place[0]])


def nearest(angle, measured, least, most):
    """Of all angles that differ from `angle` by half turns, the allowed one nearest to `measured`."""
    turns = np.round((measured - angle) / 180.0) + np.arange(-8, 9)
    candidates = angle + 180.0 * turns
    allowed = candidates[(candidates >= least) & (candidates <= most)]
    return allowed[np.argmin(np.abs(allowed - measured))]


def number(x):
    return "%.12g" % x


def main():
    rng = np.random.default_rng(SEED)
    names = ["x", "y", "measured", "speed", "angle", "mspeed", "mangle", "residual"]
    header = ["radius", "range", "vx", "vy", "wz", "mx", "my", "mwz"]
    header += [f"{name}{k}" for k in range(MODULES) for name in names]
    print(",".join(header))
    for case in range(200):
        places = rng.uniform(-0.4, 0.4, (MODULES, 2)).astype(F).astype(float)
        radius = float(F(rng.uniform(0.03, 0.08)))
        rpm = 60.0 / (2 * np.pi * radius)
        twist = (rng.uniform(-1, 1, 3) * [2, 2, 5]).astype(F).astype(float)
        # A range of ± this many whole degrees; 0: endless.
        limit = 0 if case % 2 else int(rng.integers(90, 400))
        spread = limit if limit else 5000
        measured = np.round(rng.uniform(-spread, spread, MODULES), 3)
        least, most = (-limit, limit) if limit else (-np.inf, np.inf)
        cells = []
        m_speeds = (rng.uniform(-300, 300, MODULES)).astype(F).astype(float)
        m_angles = np.round(rng.uniform(-500, 500, MODULES), 3)
        radians = np.radians(m_angles)
        ways = np.column_stack([np.cos(radians), np.sin(radians)])
        measured_velocities = (ways * (m_speeds / rpm)[:, None]).reshape(-1)
        unit = np.eye(3)
        rows = np.array(
            [[velocity(p, unit[k])[axis] for k in range(3)] for p in places for axis in range(2)]
        )
        motion = np.linalg.lstsq(rows, measured_velocities, rcond=None)[0]
        residual = np.linalg.norm((measured_velocities - rows @ motion).reshape(-1, 2), axis=1)
        for k in range(MODULES):
            v = velocity(places[k], twist)
            angle = nearest(np.degrees(np.arctan2(v[1], v[0])), measured[k], least, most)
            # Along the wheel as it stands now: the cosine of what is left.
            now = np.radians(measured[k])
            speed = (v @ [np.cos(now), np.sin(now)]) * rpm
            values = [*places[k], measured[k], speed, angle, m_speeds[k], m_angles[k], residual[k]]
            cells += [number(value) for value in values]
        first = [radius, limit, *twist, *motion]
        print(",".join([number(value) for value in first] + cells))
    sys.stdout.flush()


if __name__ == "__main__":
    main()
