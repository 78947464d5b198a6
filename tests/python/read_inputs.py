"""Reads the inputs of a record, by docs/replay.md alone: prints what each bus heard and what its motors were given."""

import json
import struct
import sys

START, TICK, FRAME, COMMAND, REQUEST = 1, 2, 3, 7, 8
TOOK, SENT, OUTGOING, POLL, BYTES, LOST = 9, 10, 11, 14, 15, 17
FIRST_LINE = 8
# Of a black box.
MAGIC, WORDS, BLOCKS, BLOCK, NUMBERS = 0x524E4732, 81864, 32, 2558, 1 << 15
TARGETS = [
    "Coast", "Current", "Duty", "Speed", "Angle", "TotalAngle", "Torque", "Impedance", "Motion", "Brake", "Handbrake",
]


def entries(words):
    """Kind, place, byte and words of each entry."""
    at = 0
    while at < len(words):
        kind, place, length, more = words[at].to_bytes(4, "little")
        yield kind, place, more, words[at + 1 : at + 1 + length]
        at += 1 + length
    assert at == len(words), "the last entry is not whole"


def mix(number, data):
    """FNV-1a, 64 bits."""
    for byte in data:
        number = (number ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return number


class Damaged(Exception):
    """No writer has written this."""


class Bits:
    """The bits of a block."""

    def __init__(self, words, end):
        self.words, self.at, self.end = words, 0, end

    def take(self, count):
        value = 0
        for bit in range(count):
            if self.at >= self.end:
                raise Damaged
            value |= (self.words[self.at // 32] >> self.at % 32 & 1) << bit
            self.at += 1
        return value

    def number(self, low):
        """None: it is said otherwise; and the zeros."""
        for zeros in range(10):
            if self.take(1):
                return zeros << low | self.take(low), zeros
        return None, 10


class Scale:
    def __init__(self):
        self.scale = 64

    def number(self, bits):
        number, zeros = bits.number(self.scale // 16)
        self.scale = min(max(self.scale + 4 * zeros - 3, 0), 240)
        return number


def unfold(number):
    return -(number >> 1) - 1 if number & 1 else number >> 1


def fold(difference, bits):
    """Of a difference that is signed in so many bits."""
    difference &= (1 << bits) - 1
    if difference >> bits - 1:
        difference -= 1 << bits
    return -2 * difference - 1 if difference < 0 else 2 * difference


class Word(Scale):
    """A word by its difference to a guess."""

    def __init__(self):
        super().__init__()
        self.last, self.step, self.before = 0, 0, 0

    def read(self, bits, is_time):
        guess = self.last + self.before if is_time else self.last
        number = self.number(bits)
        value = bits.take(32) if number is None else guess + unfold(number) & 0xFFFFFFFF
        self.step, self.before, self.last = value - self.last & 0xFFFFFFFF, self.step, value
        return value


class Half(Scale):
    """16 bits of a frame."""

    def __init__(self):
        super().__init__()
        self.last, self.step, self.steady, self.mask = 0, 0, 0, 0xFFF

    def read(self, bits):
        number = self.number(bits)
        width = self.mask.bit_length()
        if number is None:
            value = bits.take(16)
            self.mask |= (1 << value.bit_length()) - 1
        else:
            guess = self.last + (self.step if self.steady > 0 else 0)
            value = guess + unfold(number) & (1 << width) - 1
        step = value - self.last
        if value % 8 == 0:
            with_step, without = fold(step - self.step, width), fold(step, width)
            self.steady = min(max(self.steady + (with_step < without) - (with_step > without), -4), 4)
        self.last, self.step = value, step
        return value


class Slot:
    def __init__(self, head, key):
        self.head, self.key, self.next = head, key, 0
        self.time, self.word, self.halves = Word(), Word(), [Half() for _ in range(4)]


def unpack_block(words, end):
    """The entries of a block, as far as they can be read."""
    bits, slots, pairs, last = Bits(words, end), [], [0] * 256, (0, 0)
    guesses, scales, followed = [0] * 512, (Scale(), Scale()), {}
    while bits.at < end:
        try:
            choice, _ = bits.number(0)
            pair = (61 * last[0] + 7 * last[1]) % 256
            if choice in (3, 4):
                number, head = len(slots), bits.take(32)
                slot = Slot(head, bits.take(32) if is_frame(head) else 0)
                if choice == 3:
                    slots.append(slot)
            elif choice in (0, 1, 2):
                likely = [pairs[pair], followed.get(last[1], 0)]
                number = bits.take(7) if choice == 2 else likely[choice]
                slot = slots[number]
            else:
                raise Damaged
            entry = [slot.head]
            kind, _, length, _ = slot.head.to_bytes(4, "little")
            if (kind, length) in ((TICK, 2), (FRAME, 4)) or kind in (POLL, BYTES) and length:
                entry.append(slot.time.read(bits, True))
            if (kind, length) in ((TICK, 2), (TOOK, 1)):
                entry.append(slot.word.read(bits, False))
            if is_frame(slot.head):
                halves = [half.read(bits) for half in slot.halves]
                entry += [slot.key, *struct.unpack("<II", struct.pack(">4H", *halves))]
            before = 0

            def place():
                if choice == 4:
                    return (before * 0x9E3779B1 & 0xFFFFFFFF) >> 23
                return (37 * number + len(entry)) % 512

            while len(entry) <= length:
                said = scales[choice == 4].number(bits)
                said = bits.take(8) if said is None else said
                for _ in range(length + 1 - len(entry) if said == 0 else said - 1):
                    before = guesses[place()]
                    entry.append(before)
                if len(entry) <= length:
                    at = place()
                    for byte in range(4):
                        if bits.take(1):
                            guesses[at] ^= bits.take(8) << 8 * byte
                    before = guesses[at]
                    entry.append(before)
        except (Damaged, IndexError):
            return
        if choice != 4:
            pairs[pair] = followed[last[1]] = number
            last = (last[1], number)
        yield entry


def is_frame(head):
    kind, _, length, _ = head.to_bytes(4, "little")
    return (kind, length) in ((FRAME, 4), (SENT, 3), (OUTGOING, 3))


def unpack(memory):
    """The words of a black box."""
    words = struct.unpack(f"<{WORDS}I", memory)

    def block(number):
        it = words[8 + number % BLOCKS * BLOCK :][:BLOCK]
        return it if it[1] == number == it[3] >> 17 else None

    numbers = [number for at in range(BLOCKS) for number in [words[9 + at * BLOCK]] if number < NUMBERS and block(number)]
    newest = max(numbers, key=lambda it: sum((it - other) % NUMBERS < BLOCKS for other in numbers))
    found, told = [], None
    for back in reversed(range(BLOCKS)):
        it = block((newest - back) % NUMBERS)
        if it is None:
            continue
        if told not in (None, it[0]):
            found += [LOST | 1 << 16, (it[0] - told) % 2**32]
        told = it[0]
        for entry in unpack_block(it[4:], it[3] & 0x1FFFF):
            found += entry
            told += len(entry)
    return found


def read(path):
    with open(path, "rb") as file:
        memory = file.read()
    if memory[:4] == struct.pack("<I", MAGIC):
        return unpack(memory)
    from mcap_ros2.reader import read_ros2_messages

    words = []
    for message in read_ros2_messages(path, topics=["/inputs"]):
        words += message.ros_msg.words
    return words


def main(path):
    words = read(path)
    buses, ticks = {}, {}
    for kind, place, more, rest in entries(words):
        bus = buses.setdefault(place, {"frames": 0, "hash": 0, "times": [], "halves": 0, "given": {}})
        if kind in (START, TICK):
            ticks[place] = rest[0] | rest[1] << 32
            bus["halves"] += kind == TICK
        elif kind == FRAME:
            at, key, low, high = rest
            # The newest 32 bits of its time, near the tick's.
            behind = (at - ticks[place] + 2**31) % 2**32 - 2**31
            data = struct.pack("<II", low, high)[:more]
            bus["frames"] += 1
            bus["hash"] = mix(bus["hash"], struct.pack("<IB", key, more) + data)
            bus["times"].append(ticks[place] + behind)
        elif kind == COMMAND:
            text = struct.pack(f"<{len(rest)}I", *rest)
            name = TARGETS[text[0]]
            given = bus["given"].setdefault(str(more), {})
            given[name] = given.get(name, 0) + 1
    print(json.dumps(buses))


main(sys.argv[1])
