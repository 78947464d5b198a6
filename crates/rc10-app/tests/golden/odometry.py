"""Odometry by a fine path: motions integrated by scipy's Runge-Kutta in f64, covariances by numpy.

A case is a pose and a number of steps, each a constant twist for a while. The row after each step has
the pose there, and the covariance by F P F' + Q with F from finite differences of that path.
"""

import sys

import numpy as np
from scipy.integrate import solve_ivp

SEED = 7
CASES = 12
STEPS = 60
F = np.float32
# Of the configuration in the test.
PER_DISTANCE, PER_TURN, PER_TIME = 1e-4, 5e-5, 5e-6


def step(pose, twist, dt):
    def motion(_, state):
        c, s = np.cos(state[2]), np.sin(state[2])
        return [twist[0] * c - twist[1] * s, twist[0] * s + twist[1] * c, twist[2]]

    return solve_ivp(motion, (0, dt), pose, rtol=1e-11, atol=1e-13).y[:, -1]


def number(x):
    return "%.9g" % x


def main():
    rng = np.random.default_rng(SEED)
    print("case,dt,vx,vy,wz,x,y,heading,xx,xy,xt,yy,yt,tt")
    for case in range(CASES):
        pose = np.array([*rng.uniform(-6, 6, 2), rng.uniform(-3, 3)]).astype(F).astype(float)
        covariance = np.zeros((3, 3))
        start = [case, 0, 0, 0, 0, *pose, 0, 0, 0, 0, 0, 0]
        print(",".join(number(value) for value in start))
        for _ in range(STEPS):
            dt = float(F(rng.uniform(0.001, 0.05)))
            twist = (rng.uniform(-1, 1, 3) * [4, 4, 12]).astype(F).astype(float)
            after = step(pose, twist, dt)
            jacobian = np.eye(3)
            for k in range(3):
                little = np.eye(3)[k] * 1e-4
                ahead, behind = step(pose + little, twist, dt), step(pose - little, twist, dt)
                jacobian[:, k] = (ahead - behind) / 2e-4
            position = PER_DISTANCE * (abs(twist[0]) + abs(twist[1])) * dt
            heading = PER_TURN * abs(twist[2]) * dt + PER_TIME * dt
            covariance = jacobian @ covariance @ jacobian.T + np.diag([position, position, heading])
            pose = after
            wrapped = np.arctan2(np.sin(pose[2]), np.cos(pose[2]))
            upper = covariance[np.triu_indices(3)]
            row = [case, dt, *twist, pose[0], pose[1], wrapped, *upper]
            print(",".join(number(value) for value in row))
    sys.stdout.flush()


if __name__ == "__main__":
    main()
