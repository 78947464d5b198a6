"""PID controllers by scipy: every part is a linear filter, so the output is a sum of `lfilter`s, and a
loop around a plant is a transfer function.

open: random setpoints and measurements, controllers that never reach a limit. closed: the step response
of a loop around a first-order plant, as one transfer function.
"""
import numpy as np
from scipy.signal import lfilter

rng = np.random.default_rng(16)
print("case,kp,ki,kd,filter,weight,dt,setpoint,measured,output")


def row(case, gains, dt, setpoint, measured, output):
    numbers = [*gains, dt, setpoint, measured, output]
    print(",".join([case] + ["%.9g" % number for number in numbers]))


for case in range(20):
    kp, ki, kd = rng.uniform(0.1, 5), rng.uniform(0, 50), rng.choice([0.0, rng.uniform(0.001, 0.1)])
    tau, weight = rng.choice([0.0, rng.uniform(0.001, 0.05)]), rng.choice([1.0, rng.uniform(0, 1)])
    dt = rng.choice([0.001, 0.005, 0.01])
    gains = [np.float32(x).astype(float) for x in (kp, ki, kd, tau, weight)]
    kp, ki, kd, tau, weight = gains
    dt = float(np.float32(dt))
    steps = 60
    setpoint = np.float32(np.repeat(rng.uniform(-10, 10, 6), 10)).astype(float)
    measured = np.float32(np.cumsum(rng.normal(0, 0.3, steps))).astype(float)
    error = setpoint - measured
    proportional = kp * (weight * setpoint - measured)
    # Trapezoids; before the first step the error was zero.
    integral = lfilter([ki * dt / 2, ki * dt / 2], [1, -1], error)
    # The backward difference of s / (tau s + 1); before the first step nothing moved.
    change = np.diff(measured, prepend=measured[0])
    derivative = kd * lfilter([1.0], [tau + dt, -tau], change)
    output = proportional + integral - derivative
    for k in range(steps):
        row("open%d" % case, gains, dt, setpoint[k], measured[k], output[k])

for case in range(10):
    kp, ki = rng.uniform(0.5, 4), rng.uniform(1, 30)
    kd, tau, weight = rng.uniform(0, 0.02), rng.uniform(0.002, 0.02), rng.uniform(0.2, 1)
    gains = [np.float32(x).astype(float) for x in (kp, ki, kd, tau, weight)]
    kp, ki, kd, tau, weight = gains
    dt = float(np.float32(0.001))
    # A plant of time constant 0.1 s and gain 2, sampled with a hold: y[k+1] = a y[k] + b u[k].
    a = np.exp(-dt / 0.1)
    b = 2 * (1 - a)
    # All as polynomials of z: C = kp + I + D, u = F r - C y.
    i_num, i_den = np.array([ki * dt / 2, ki * dt / 2]), np.array([1.0, -1.0])
    d_num, d_den = kd * np.array([1.0, -1.0]), np.array([tau + dt, -tau])
    den = np.polymul(i_den, d_den)
    feedback = np.polyadd(np.polyadd(kp * den, np.polymul(i_num, d_den)), np.polymul(d_num, i_den))
    forward = np.polyadd(kp * weight * den, np.polymul(i_num, d_den))
    plant_num, plant_den = np.array([b]), np.array([1.0, -a])
    closed_num = np.polymul(forward, plant_num)
    closed_den = np.polyadd(np.polymul(den, plant_den), np.polymul(feedback, plant_num))
    closed_num = np.pad(closed_num, (len(closed_den) - len(closed_num), 0))
    steps = 400
    y = lfilter(closed_num, closed_den, np.ones(steps))
    for k in range(0, steps, 4):
        row("closed%d" % case, gains, dt, 1.0, y[k], float(k))
