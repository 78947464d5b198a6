"""Time-optimal profiles of random targets, by ruckig (https://github.com/pantor/ruckig), in f64.

ruckig is an implementation of its own: L. Berscheid and T. Kroeger, Jerk-limited real-time trajectory
generation with arbitrary target states, RSS 2021. A line is a state, a target and limits, then the
duration, and position, velocity and acceleration at a quarter, a half and three quarters of it.

The kind is "rest" from rest to rest over a way long enough for all limits to be reached, "state" from any
state to rest, "through" to a velocity at the target, "moving" for a target that moves (computed in its
frame), "velocity" for a velocity without a position.
"""

import random

from ruckig import (
    ControlInterface,
    InputParameter,
    Result,
    Ruckig,
    RuckigError,
    Trajectory,
)

random.seed(1)


def f32(x):
    """Nine digits are an f32."""
    return float("%.7g" % x)


def scale(low, high):
    return low * (high / low) ** random.random()


def state(velocity, acceleration, jerk):
    """A state from which the velocity stays within its limit."""
    while True:
        v = random.uniform(-velocity, velocity)
        a = random.uniform(-acceleration, acceleration)
        if random.random() < 0.2:
            a = random.choice([-acceleration, 0.0, acceleration])
        if abs(v + a * abs(a) / (2 * jerk)) < 0.999 * velocity:
            return f32(v), f32(a)


def line(kind):
    velocity = scale(0.1, 20)
    acceleration = velocity / scale(0.01, 10)
    jerk = acceleration / scale(0.001, 1)
    velocity, acceleration, jerk = f32(velocity), f32(acceleration), f32(jerk)
    if acceleration * acceleration / jerk > velocity:
        return None  # The acceleration limit is never reached: other limits, please.
    braking = velocity * (velocity / acceleration + acceleration / jerk)
    v, a = (0.0, 0.0) if kind == "rest" else state(velocity, acceleration, jerk)
    to = random.uniform(-0.95, 0.95) * velocity if kind in ("through", "moving", "velocity") else 0.0
    if kind == "rest":
        way = random.choice([-1, 1]) * random.uniform(1.001, 4) * braking
    else:
        way = random.uniform(-2, 2) * braking * random.choice([1, 0.1])
    way, to = f32(way), f32(to)
    frame = to if kind == "moving" else 0.0

    problem = InputParameter(1)
    problem.current_position = [0.0]
    problem.current_velocity = [v - frame]
    problem.current_acceleration = [a]
    problem.target_position = [way]
    problem.target_velocity = [to - frame]
    problem.target_acceleration = [0.0]
    problem.max_velocity = [velocity - frame]
    problem.min_velocity = [-velocity - frame]
    problem.max_acceleration = [acceleration]
    problem.max_jerk = [jerk]
    if kind == "velocity":
        problem.control_interface = ControlInterface.Velocity
    trajectory = Trajectory(1)
    try:
        if Ruckig(1).calculate(problem, trajectory) not in (Result.Working, Result.Finished):
            return None
    except RuckigError:  # Its own numbers failed: another sample, please.
        return None
    fields = [kind, velocity, acceleration, jerk, v, a, way, to, trajectory.duration]
    for share in (0.25, 0.5, 0.75):
        time = share * trajectory.duration
        position, speed, acceleration = trajectory.at_time(time)
        fields += [position[0] + frame * time, speed[0] + frame, acceleration[0]]
    return ",".join(x if isinstance(x, str) else "%.9g" % x for x in fields)


samples = [f"{name}_{share}" for share in (25, 50, 75) for name in ("position", "velocity", "acceleration")]
print(",".join(["kind,max_velocity,max_acceleration,max_jerk,velocity,acceleration,way,to,duration", *samples]))
for kind, count in (("rest", 150), ("state", 350), ("through", 250), ("moving", 200), ("velocity", 100)):
    while count > 0:
        text = line(kind)
        if text:
            print(text)
            count -= 1
