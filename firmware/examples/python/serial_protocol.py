"""The frames and messages of any protocol of tiltproof (docs/protocol.md), for a client in Python.

    protocol = Protocol(json.load(open("quad.json")))   # tiltproof protocol check quad.yaml --format json > quad.json
    port.write(protocol.frame("request"))
    for name, values in protocol.receiver().feed(port.read()):
        ...                                             # values: {"x_m": 1.25, ...}

Sequences and times are written and checked here: a message that repeats, or is older than the last one of its name, is
dropped.
"""
import binascii
import math
import re
import struct
import time
import zlib

CODES = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f", "f64": "d"}
PAYLOAD_BYTES_MAX = 256


def fletcher16(payload):
    first = second = 0
    for byte in payload:
        first = (first + byte) % 255
        second = (second + first) % 255
    return bytes((first, second))


def crc16_ibm_sdlc(payload):
    crc = 0xFFFF
    for byte in payload:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return (crc ^ 0xFFFF).to_bytes(2, "little")


CHECKS = {
    "fletcher16": fletcher16,
    "crc16_ibm_3740": lambda payload: binascii.crc_hqx(payload, 0xFFFF).to_bytes(2, "big"),
    "crc16_ibm_sdlc": crc16_ibm_sdlc,
    "crc32_iso_hdlc": lambda payload: zlib.crc32(payload).to_bytes(4, "little"),
    "sum8": lambda payload: bytes((sum(payload) % 256,)),
    "none": lambda payload: b"",
}


class Hdlc:
    def __init__(self, _framing):
        self.received = b""

    @staticmethod
    def frame(content):
        return b"\x7e" + content.replace(b"\x7d", b"\x7d\x5d").replace(b"\x7e", b"\x7d\x5e") + b"\x7e"

    def contents(self, received):
        *bodies, self.received = (self.received + received).split(b"\x7e")
        self.received = self.received[-4 * PAYLOAD_BYTES_MAX :]
        for body in bodies:
            content = re.sub(b"\x7d(.)", lambda escaped: bytes((escaped[1][0] ^ 0x20,)), body, flags=re.DOTALL)
            if len(re.findall(b"\x7d.?", body, re.DOTALL)) == len(body) - len(content):  # else it ends in an escape
                yield content


class Cobs:
    def __init__(self, _framing):
        self.received = b""

    @staticmethod
    def frame(content):
        stuffed, code = bytearray(1), 0
        for byte in content:
            if len(stuffed) - code == 0xFF:
                stuffed[code], code = 0xFF, len(stuffed)
                stuffed.append(0)
            if byte == 0:
                stuffed[code], code = len(stuffed) - code, len(stuffed)
            stuffed.append(byte)
        stuffed[code] = len(stuffed) - code
        return bytes(stuffed) + b"\x00"

    def contents(self, received):
        *bodies, self.received = (self.received + received).split(b"\x00")
        self.received = self.received[-4 * PAYLOAD_BYTES_MAX :]
        for body in bodies:
            content = b""
            while body:
                code, block, body = body[0], body[1 : body[0]], body[body[0] :]
                if len(block) != code - 1:
                    break  # the frame ends before the block
                content += block + (b"\x00" if code < 0xFF and body else b"")
            else:
                yield content


class LengthPrefixed:
    def __init__(self, framing):
        self.sync, self.length_bytes = bytes(framing["sync"]), framing["length_bytes"]
        self.check_bytes = framing["check_bytes"]
        self.received = b""

    def frame(self, content):
        return self.sync + (len(content) - self.check_bytes).to_bytes(self.length_bytes, "little") + content

    def contents(self, received):
        self.received += received
        while (begin := self.received.find(self.sync)) >= 0:
            behind = begin + len(self.sync) + self.length_bytes
            if behind > len(self.received):
                return
            length = int.from_bytes(self.received[behind - self.length_bytes : behind], "little")
            end = behind + length + self.check_bytes
            if length > PAYLOAD_BYTES_MAX:
                self.received = self.received[behind:]
                continue
            if end > len(self.received):
                return
            yield self.received[behind:end]
            self.received = self.received[end:]
        self.received = self.received[-(len(self.sync) - 1) :] if len(self.sync) > 1 else b""


FRAMINGS = {"hdlc": Hdlc, "cobs": Cobs, "length_prefixed": LengthPrefixed}


def format_of(number):
    return (">" if number["byte_order"] == "big" else "<") + CODES[number["type"]]


def stored(field, value):
    """The bytes of a value: integers are rounded half away from zero, and end at the limits of their type."""
    number, code = value / field["scale"], format_of(field)
    if field["type"] in ("f32", "f64"):
        return struct.pack(code, number)
    bits = 8 * struct.calcsize(code)
    least, largest = (0, 2**bits - 1) if field["type"][0] == "u" else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    whole = math.copysign(math.floor(abs(number) + 0.5), number)
    return struct.pack(code, int(min(max(whole, least), largest)))


class Protocol:
    def __init__(self, description):
        self.description = description
        self.messages = {message["name"]: message for message in description["messages"]}
        self.check = CHECKS[description["framing"]["check"]]
        self.framing = FRAMINGS[description["framing"]["type"]](description["framing"])
        self.sent_counts = dict.fromkeys(self.messages, 0)
        self.now_ns = time.monotonic_ns  # in lockstep, another clock

    @property
    def period_s(self):
        return self.description["control_period_ms"] / 1e3

    def of_role(self, role):
        return [message for message in self.messages.values() if message["role"] == role]

    def payload(self, name, values=None):
        """`values`: by signal. The number and the time of the message are added."""
        message = self.messages[name]
        own = dict(values or {}, sequence=self.sent_counts[name], time_us=self.now_ns() // 1000)
        self.sent_counts[name] += 1
        number = b"" if message["id"] is None else stored(dict(message["id"], scale=1), message["id"]["value"])
        for field in message["fields"]:
            value = own[field["signal"]]
            if field["content"] != "signal":
                value %= 2 ** (8 * struct.calcsize(format_of(field)))
            number += stored(field, value)
        return number

    def frame(self, name, values=None):
        payload = self.payload(name, values)
        return self.framing.frame(payload + self.check(payload))

    def decode(self, payload, direction):
        """The name of the message and its values by signal; None when the payload is no message of that direction."""
        for message in self.messages.values():
            own_id = b"" if message["id"] is None else stored(dict(message["id"], scale=1), message["id"]["value"])
            if (message["from"], message["line"]) != direction or not payload.startswith(own_id):
                continue
            if len(payload) != message["payload_bytes"]:
                return None
            values = {}
            for field in message["fields"]:
                value = struct.unpack_from(format_of(field), payload, field["offset"])[0]
                if field["content"] == "signal":
                    value *= field["scale"]
                # The check misses some damage. NaN fails, too.
                if not field["min"] <= value <= field["max"]:
                    return None
                values[field["signal"]] = value
            return message["name"], values
        return None

    def receiver(self, line="main", sender="server"):
        return Receiver(self, (sender, line))


class Receiver:
    """One line's bytes; yields the messages in them."""

    def __init__(self, protocol, direction):
        self.protocol, self.direction = protocol, direction
        self.framing = FRAMINGS[protocol.description["framing"]["type"]](protocol.description["framing"])
        self.last = {}

    def feed(self, received):
        check_bytes = self.protocol.description["framing"]["check_bytes"]
        for content in self.framing.contents(received):
            payload = content[: len(content) - check_bytes]
            if not payload or len(payload) > PAYLOAD_BYTES_MAX or self.protocol.check(payload) != content[len(payload) :]:
                continue
            message = self.protocol.decode(payload, self.direction)
            if message is not None and self.is_newer(*message):
                self.last[message[0]] = message[1]
                yield message

    def is_newer(self, name, values):
        for field in self.protocol.messages[name]["fields"]:
            if field["content"] != "signal" and name in self.last:
                whole = 2 ** (8 * struct.calcsize(format_of(field)))
                if not 0 < (values[field["signal"]] - self.last[name][field["signal"]]) % whole < whole / 2:
                    return False
        return True
