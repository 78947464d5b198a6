"""python-can as a CAN adapter: who connects here speaks slcan, and its frames go to a bus of python-can, and back.

Argument: the address of another slcan adapter, as pyserial takes it. Prints its own port.
"""

import socket
import sys
import threading

import can


def line_of(message):
    """A frame as a line of slcan."""
    letter = "r" if message.is_remote_frame else "t"
    name = f"{letter.upper()}{message.arbitration_id:08X}" if message.is_extended_id else f"{letter}{message.arbitration_id:03X}"
    data = "" if message.is_remote_frame else message.data.hex().upper()
    return f"{name}{message.dlc}{data}\r".encode()


def message_of(line):
    """The frame of a line of slcan; None of a command to the adapter."""
    letter, text = line[:1].decode(), line[1:].decode()
    if letter not in "tTrR" or not text:
        return None
    digits = 8 if letter.isupper() else 3
    is_remote = letter in "rR"
    return can.Message(
        arbitration_id=int(text[:digits], 16),
        is_extended_id=letter.isupper(),
        is_remote_frame=is_remote,
        dlc=int(text[digits], 16),
        data=None if is_remote else bytes.fromhex(text[digits + 1 :]),
    )


def main():
    server = socket.create_server(("127.0.0.1", 0))
    print("port", server.getsockname()[1], flush=True)
    client, _ = server.accept()
    client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    bus = can.Bus(
        interface="slcan", channel=sys.argv[1], bitrate=1_000_000, sleep_after_open=0
    )

    def hear():
        for message in bus:
            client.sendall(line_of(message))

    threading.Thread(target=hear, daemon=True).start()
    rest = b""
    while data := client.recv(4096):
        *lines, rest = (rest + data).split(b"\r")
        for message in filter(None, map(message_of, lines)):
            bus.send(message)


main()
