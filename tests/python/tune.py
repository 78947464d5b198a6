"""Estimates what a motor moves from a record, by numpy and scipy: no code of ours, and another method.

Arguments: the file, the topic of the motor. Prints one JSON object: inertia (effort per rpm/s), friction, viscous
(effort per rpm), delay (s).

Speed and effort go through the same Gaussian, whose derivative gives the acceleration; then a robust fit of the
equation of motion, with the delay of the effort as one more unknown.
"""

import json
import sys

import numpy
from mcap_ros2.reader import read_ros2_messages
from scipy.ndimage import gaussian_filter1d, minimum_filter1d
from scipy.optimize import least_squares

# Width of the Gaussian, and how far from a reversal a moment counts, in samples of a millisecond.
WIDTH = 12
APART = 40


def main():
    file, topic = sys.argv[1:]
    rows = []
    for message in read_ros2_messages(file, topics=[topic]):
        said = message.ros_msg
        rows.append([message.log_time_ns * 1e-9, said.total_angle, said.effort])
    at, angle, effort = numpy.array(rows).T
    drives = numpy.isfinite(effort)
    effort[~drives] = 0.0
    step = numpy.median(numpy.diff(at))
    raw = numpy.gradient(angle) / step / 6
    speed = gaussian_filter1d(raw, WIDTH)
    acceleration = gaussian_filter1d(raw, WIDTH, order=1) / step
    smooth = gaussian_filter1d(effort, WIDTH)
    # It turns one way all around, and not at its slowest.
    fast = numpy.percentile(numpy.abs(speed), 98)
    turns = minimum_filter1d(drives * numpy.abs(speed), 2 * APART + 1) > 0.15 * fast
    turns[:200] = turns[-200:] = False

    def off(numbers):
        inertia, friction, viscous, constant, delay = numbers
        given = numpy.interp(at - delay * 1e-3, at, smooth)[turns]
        of_motion = inertia * acceleration + friction * numpy.sign(speed) + viscous * speed
        return given - of_motion[turns] - constant

    size = numpy.abs(effort).max()
    scale = [size / numpy.abs(acceleration).max(), size / 10, size / 10 / fast, size / 10, 1.0]
    begin = [scale[0], scale[1], scale[2], 0.0, 2.0]
    found = least_squares(off, begin, x_scale=scale, loss="soft_l1", f_scale=size / 200)
    inertia, friction, viscous, _, delay = found.x
    print(json.dumps({"inertia": inertia, "friction": friction, "viscous": viscous, "delay": delay * 1e-3}))


main()
