"""Inputs that are nearly right: valid TOML with some values changed, or some bytes."""

from __future__ import annotations

import copy
import datetime
import math
import random
from collections.abc import Callable, Sequence
from typing import Any

Tree = dict[str, Any]

EXTREMES: Sequence[Any] = (
    0, 1, -1, 2, 3, 7, 100, 0.0, -0.0, 0.1, 0.5, 0.9, 1.0, -0.5, 1e-3, 1e3, 1e-6, 1e6, 1e-15, 1e16, 1e-300, 1e300,
    5e-324, 1.7976931348623157e308, -1.7976931348623157e308, math.nan, math.inf, -math.inf, 2**31, 2**32 + 1, 2**53 + 1,
    2**63 - 1, -(2**63), 2**64, 10**400, True, False, "", " ", "x", "paper", "linear", "a\nb", "\u2028", "\x7f\x85",
    "é", "\U0001f600", "../..", "/dev/zero", "x" * 3000, "$\\frac{", "<script>", "]]>", [], [[]], {}, [1.0], [1.0, 1.0],
    [0.0, 0.0], [1.0, 2.0, 3.0], [1, "x"], [True, False], [[0.0, 1.0], [1.0, 2.0]], [[1.0, 0.0], [0.0, 1.0]],
    [math.nan, 1.0], [math.inf, 1e308], [10**400], {"x": 1}, {"low": 0.1, "high": 0.2},
    {"a": {"b": {"c": [1, {"d": 2}]}}}, datetime.date(1979, 5, 27),
    datetime.time(7, 32), datetime.datetime(1979, 5, 27, 7, 32),
)  # fmt: skip
TOKENS = (
    b"=", b"[", b"]", b"[[", b"]]", b"{", b"}", b'"', b"'", b'"""', b"'''", b"\n", b"\r", b"\0", b"\xff", b"\xc3",
    b"\xef\xbb\xbf", b".", b",", b"#", b"nan", b"inf", b"0x", b"0xffffffffffffffffffffff", b"1e999", b"-", b"_", b"\\",
    b"\\u0000", b"\\ud800", b"\xe2\x80\xa8", b"9" * 5000, b"[" * 3000, b"{a=" * 300, b"a." * 300,
    b"true", b"1979-05-27",
)  # fmt: skip


def paths(tree: Any) -> list[tuple[Any, ...]]:
    """Path of every value, including tables and lists."""
    entries = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    return [way for key, inner in entries for way in [(key,), *((key, *deeper) for deeper in paths(inner))]]


def at(tree: Any, way: Sequence[Any]) -> Any:
    for key in way:
        tree = tree[key]
    return tree


def extreme(rng: random.Random) -> Any:
    return copy.deepcopy(rng.choice(EXTREMES))


def value(rng: random.Random, old: Any, others: Callable[[], Any]) -> Any:
    """Something instead of `old`: close to it, extreme, or from elsewhere in the document."""
    kind = rng.random()
    if isinstance(old, float | int) and not isinstance(old, bool) and not abs(old) > 1e300 and kind < 0.45:
        whole = int(min(max(old, -1e18), 1e18)) if math.isfinite(old) else 1
        near = [old * 2, old / 2, -old, old * 10 ** rng.uniform(-6, 6), old + rng.uniform(-1, 1), whole]
        near += [math.nextafter(old, math.inf), rng.lognormvariate(0, 3), rng.randrange(1, 9)]
        return rng.choice(near)
    if isinstance(old, list) and old and kind < 0.3:
        return rng.choice([old[:-1], old + old[:1], old[::-1], [value(rng, entry, others) for entry in old], [old]])
    return copy.deepcopy(others()) if kind > 0.85 else extreme(rng)


def change(rng: random.Random, tree: Tree, names: Sequence[str]) -> None:
    """One edit in place: a value, a name, an entry more or less; `names` are meaningful words."""
    ways = paths(tree)
    if not ways or rng.random() < 0.02:
        tree[rng.choice(names)] = extreme(rng)
        return
    way = rng.choice(ways)
    parent, last = at(tree, way[:-1]), way[-1]
    edit = rng.random()
    if edit < 0.72:
        parent[last] = value(rng, parent[last], lambda: at(tree, rng.choice(ways)))
    elif edit < 0.82:
        del parent[last]
    elif isinstance(parent, dict):
        name = rng.choice([*names, str(last)[:-1], f"{last}{rng.choice('xé .')}", "", str(last).upper()])
        parent[name] = parent.pop(last) if edit < 0.88 else extreme(rng)
    else:
        parent.insert(rng.randrange(len(parent) + 1), extreme(rng))


def toml(tree: Tree) -> str:
    """The tree as TOML, with tables of the first level under headings."""
    plain = {name: entry for name, entry in tree.items() if not isinstance(entry, dict)}
    lines = [f"{_key(name)} = {_value(entry)}" for name, entry in plain.items()]
    for name, table in tree.items():
        if isinstance(table, dict):
            lines += [f"[{_key(name)}]", *(f"{_key(field)} = {_value(entry)}" for field, entry in table.items())]
    return "\n".join(lines) + "\n"


def _key(name: Any) -> str:
    words = str(name).split(".")
    return ".".join(words) if all(word.isascii() and word.isidentifier() for word in words) else _text(str(name))


def _text(text: str) -> str:
    escaped = "".join(f"\\u{ord(c):04x}" if ord(c) < 32 or c in '"\\\x7f' else c for c in text)
    return f'"{escaped}"'


def _value(entry: Any) -> str:
    if isinstance(entry, dict):
        return "{" + ", ".join(f"{_key(name)} = {_value(inner)}" for name, inner in entry.items()) + "}"
    if isinstance(entry, list | tuple):
        return "[" + ", ".join(map(_value, entry)) + "]"
    if isinstance(entry, bool):
        return str(entry).lower()
    if isinstance(entry, datetime.date | datetime.time):
        return entry.isoformat()
    return _text(entry) if isinstance(entry, str) else repr(entry)


def damage(rng: random.Random, data: bytes) -> bytes:
    """Some bytes flipped, deleted, doubled or inserted."""
    found = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 2, 4, 16])):
        place, size = rng.randrange(len(found) + 1), rng.choice([1, 1, 2, 8, 64, 512])
        edit = rng.randrange(6)
        if edit == 0 and place < len(found):
            found[place] ^= 1 << rng.randrange(8)
        elif edit == 1:
            del found[place : place + size]
        elif edit == 2:
            found[place:place] = rng.choice(TOKENS)
        elif edit == 3:
            found[place:place] = found[rng.randrange(len(found) + 1) :][:size]
        elif edit == 4:
            found[place : place + size] = rng.randbytes(size)
        else:
            del found[place:]
    return bytes(found)
