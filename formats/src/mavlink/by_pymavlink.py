"""The figures of pymavlink 2.4.50 that tests.rs is held against.

    python3 by_pymavlink.py

Every message of the dialect has contents of bytes from a generator that tests.rs has too. The first line is the number
of types, then the seeds and lengths of all types as a checksum. The others are the number of values and the sum of
asinh(value) of all messages: finite numbers, and the bytes of texts before their first zero. Then follow frames of
MAVLink 1, of MAVLink 2, and with a signature.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as dialect
from pymavlink.generator.mavcrc import x25crc

LONGEST_ARRAY = 64


def bytes_of(seed, count):
    """The upper bytes of a linear congruential generator (Knuth, MMIX)."""
    found = []
    for _ in range(count):
        seed = (seed * 6364136223846793005 + 1442695040888963407) % 2**64
        found.append(seed >> 56)
    return bytes(found)


def decoded(kind, content):
    head = bytes([0xFD, len(content), 0, 0, 7, 1, 1]) + kind.id.to_bytes(3, "little")
    sum_ = x25crc(head[1:] + content + bytes([kind.crc_extra])).crc
    return dialect.MAVLink(None).decode(bytearray(head + content + sum_.to_bytes(2, "little")))


def values(message):
    for name in message.get_fieldnames():
        value = getattr(message, name)
        if isinstance(value, str):
            yield from getattr(message, f"_{name}_raw").split(b"\0")[0]
        elif isinstance(value, list):
            yield from value if len(value) <= LONGEST_ARRAY else []
        else:
            yield value


def main():
    kinds = [dialect.mavlink_map[number] for number in sorted(dialect.mavlink_map)]
    sizes = [kind.unpacker.size for kind in kinds]
    told = b"".join(bytes([kind.crc_extra, size]) for kind, size in zip(kinds, sizes))
    print(len(kinds), hex(x25crc(told).crc))
    for round_ in range(4):
        count, total = 0, 0.0
        for kind, size in zip(kinds, sizes):
            content = bytes_of(kind.id * 4 + round_, max(1, size - round_))
            finite = [value for value in values(decoded(kind, content)) if math.isfinite(value)]
            count += len(finite)
            total += sum(map(math.asinh, finite))
        print(round_, count, f"{total:.6f}")
    sender = dialect.MAVLink(None, srcSystem=3, srcComponent=158)
    sender.seq = 200
    attitude = dialect.MAVLink_attitude_message(4294967290, 0.25, -0.5, 3.0, 0.125, -2.0, 1.5)
    print(attitude.pack(sender, force_mavlink1=True).hex())
    fix = dialect.MAVLink_gps_raw_int_message(
        5000000, 3, -353632610, 1491652300, 584000, 121, 200, 1500, 27000, 14, 605000, 1200, 2500, 300
    )
    print(fix.pack(sender).hex())
    sender.signing.secret_key, sender.signing.sign_outgoing = bytes(32), True
    print(dialect.MAVLink_statustext_message(6, b"Takeoff").pack(sender).hex())


main()
