"""The driver damiao-motor drives a simulated DM-J4310 (CAN_ID 1, MST_ID 0x11) over slcan.

Argument: the pseudo-terminal of `rc10 pty --lockstep --alone`: each frame that is sent lets one
millisecond pass, so that a loop of N commands is N ms of the motor's life. Prints one JSON object.
"""

import json
import sys
import time

from damiao_motor import DaMiaoController


def wait_for(condition, what):
    """The driver reads in a thread of its own; how long it takes is no matter."""
    deadline = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline, f"no {what}"
        time.sleep(0.001)


def main():
    controller = DaMiaoController(channel=sys.argv[1], bustype="slcan")
    motor = controller.add_motor(motor_id=1, feedback_id=0x11, motor_type="4310")
    heard, answers = [], []
    decode = motor.process_feedback_frame

    def listen(data, arbitration_id=None):
        heard.append(arbitration_id)
        decode(data, arbitration_id=arbitration_id)
        answers.append((arbitration_id, dict(motor.state)))

    motor.process_feedback_frame = listen

    def answered(act):
        """Does it; the motor's state by the answer to it."""
        # A register read by the driver is known to it a moment before its frame stands in the list.
        wait_for(lambda: len(answers) == len(heard), "end of the frame before")
        before = len(answers)
        act()
        wait_for(lambda: len(answers) > before, "answer")
        assert len(answers) == before + 1, "more than one answer"
        identifier, state = answers[-1]
        assert identifier == 0x11, f"answered with {identifier:#x}"
        return state

    found = {
        "registers": {
            name: motor.get_register(number, timeout=20)
            for name, number in {"can_id": 8, "mst_id": 7, "mode": 10, "p": 21, "v": 22, "t": 23}.items()
        }
    }
    motor.ensure_control_mode("MIT")
    found["before"] = answered(motor.request_motor_feedback)
    found["enabled"] = answered(motor.enable)
    def command():
        motor.send_cmd_mit(target_position=1.0, stiffness=50.0, damping=1.0)
    found["path"] = [answered(command)["pos"] for _ in range(400)]
    found["reached"] = answered(command)
    # Velocity by damping alone, torque by feed-forward alone.
    def turn():
        motor.send_cmd_mit(target_velocity=-5.0, damping=2.0)
    found["turning"] = [answered(turn) for _ in range(200)][-1]
    found["disabled"] = answered(motor.disable)
    # A register that is written, and a mode that the driver verifies by itself.
    answered(lambda: motor.write_register(9, 4321))
    motor.registers.clear()
    found["timeout"] = motor.get_register(9, timeout=20)
    controller.shutdown()
    print(json.dumps(found))


main()
