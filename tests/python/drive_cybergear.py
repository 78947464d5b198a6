"""The driver python-cybergear drives a simulated CyberGear (identifier 0x7F) over slcan.

Argument: the pseudo-terminal of `rc10 pty --lockstep --alone`: each frame that is sent lets one
millisecond pass, so that a loop of N commands is N ms of the motor's life. Prints one JSON object.
"""

import json
import sys
import time
from dataclasses import asdict

from cybergear import CyberGearMotor

BUS = {
    "interface": "slcan",
    "channel": sys.argv[1],
    "bitrate": 1_000_000,
    "sleep_after_open": 0,
}


def wait_for(condition, what):
    """The driver reads in a thread of its own; how long it takes is no matter."""
    deadline = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline, f"no {what}"
        time.sleep(0.001)


def main():
    scanned = CyberGearMotor.scan(bus_config=BUS)
    found = {"scanned": [[identifier, chip.hex()] for identifier, chip in scanned]}
    with CyberGearMotor(bus_config=BUS, can_id=0x7F, poll_interval=None) as motor:
        found["device"] = motor.device_id
        answers, parameters = [], {}
        motor.add_feedback_listener(answers.append)
        motor.add_parameter_listener(parameters.__setitem__)

        def answered(act, count=1):
            """Does it; the motor's state by the last of so many answers to it."""
            before = len(answers)
            act()
            wait_for(lambda: len(answers) >= before + count, "answer")
            return asdict(answers[-1])

        def polled():
            """All parameters, read anew."""
            parameters.clear()
            motor.start_polling(0.01)
            wait_for(lambda: len(parameters) == 18, f"all parameters, only {sorted(parameters)}")
            motor.stop_polling()
            return dict(parameters)

        def write(name, value):
            """The motor answers with its state to each parameter that is written."""
            return answered(lambda: setattr(motor, name, value))

        write("run_mode", "operation")
        # It clears faults first: two frames, two answers.
        found["enabled"] = answered(motor.enable, 2)

        def command():
            motor.motor_control(torque=0.0, position=1.0, velocity=0.0, kp=50.0, kd=1.0)

        found["path"] = [answered(command)["position"] for _ in range(400)]
        found["reached"] = answered(command)
        found["parameters"] = polled()
        found["disabled"] = answered(motor.disable)

        # Its own speed loop, with what the driver writes as parameters.
        write("run_mode", "speed")
        write("limit_cur", 5.0)
        answered(motor.enable, 2)
        write("spd_ref", 4.0)
        for _ in range(20):
            speed = polled()
        found["speed"] = speed
        found["stopped"] = answered(motor.disable)
    print(json.dumps(found))


main()
