"""Bytes in the format of a saved state. All integrations save a prefix that names the controller, CRC-32, then the
state."""

from __future__ import annotations

import random
import struct
import zlib

# Integers and doubles that are invalid as an index, a switch or a number.
WORDS = [struct.pack("<q", word) for word in (0, 1, 2, 12, 64, 255, 2**31, 2**32 + 1, 2**62, -1, -(2**63))]
WORDS += [struct.pack("<d", word) for word in (float("nan"), float("inf"), -float("inf"), 1e300, -1.0, 5e-324)]


def sealed(prefix: bytes, body: bytes) -> bytes:
    """Payload with a valid checksum, as from an attacker or a faulty writer."""
    return prefix + struct.pack("<I", zlib.crc32(body)) + body


def payload(rng: random.Random, prefix: int, states: list[bytes], others: list[bytes]) -> bytes:
    """`prefix`: its length; `others`: states of other controllers."""
    saved = rng.choice(states)
    name, body = saved[:prefix], bytearray(saved[prefix + 4 :])
    match rng.randrange(9):
        case 0:
            return rng.randbytes(rng.randrange(2 * len(saved)))
        case 1:
            flipped = bytearray(saved)
            for _ in range(rng.randint(1, 8)):
                flipped[rng.randrange(len(saved))] ^= 1 << rng.randrange(8)
            return bytes(flipped)
        case 2:
            return saved[: rng.randrange(len(saved))] if rng.randrange(2) else saved + rng.randbytes(rng.randint(1, 99))
        case 3:
            return rng.choice(others)
        case 4:
            return sealed(name, rng.randbytes(len(body)))
        case 5:
            return sealed(name, rng.randbytes(rng.randrange(2 * len(body))))
        case 6:
            for _ in range(rng.randint(1, 4)):
                at = 8 * rng.randrange(len(body) // 8)
                body[at : at + 8] = rng.choice(WORDS)
        case 7:
            for _ in range(rng.randint(1, 16)):
                body[rng.randrange(len(body))] = rng.randrange(256)
        case 8:
            at, other = rng.randrange(len(body)), rng.choice(others)
            body[at:] = (other[prefix + 4 :] + bytes(body))[: len(body)][at:]
    return sealed(name, bytes(body))
