"""Fuzzes what restores a saved state, in Python and in the browser's module; fuzz_fmu.py does so in FMUs.

    python tests/fuzz/fuzz_states.py --seconds 60 --seed 1

Whatever the bytes, they are refused in one sentence or the controller goes on from them: it dies of none, and none that
are damaged are taken. What finds something is left in tests/fuzz/corpus/states, which every run begins with. Ends with
exit code 1 on a finding.
"""

from __future__ import annotations

import argparse
import re
import struct
import subprocess
import sys
import tempfile
import zlib
from itertools import chain
from pathlib import Path

import fracgyro as fg

sys.path.insert(0, str(Path(__file__).parent))
from apart import Notebook, arguments, corpus, indices, watched
from payloads import payload

PAPER = fg.Scenario.paper().replace({"run.duration": 2.0, "controller.switching_limit": 0.5})
SCENARIOS = [
    PAPER,
    PAPER.replace({"adaptation.kind": "composite", "controller.order": 0.5}),
    PAPER.replace({"controller.kind": "linear", "controller.force_limit": 1000.0}),
    PAPER.replace({"device.sensing": "position", "controller.derivative": "caputo"}),
]
MOTION = ([0.5, 0.25], [0.0, 0.1])
IN_BROWSER = 3  # of the scenarios: it has no observer


def damaged(attempt: bytes, prefix: int) -> bool:
    """Whether the checksum shows it."""
    return attempt[prefix : prefix + 4] != struct.pack("<I", zlib.crc32(attempt[prefix + 4 :]))


def states_of(controller: fg.Controller) -> list[bytes]:
    """At the start, after one sample and after many."""
    found = [controller.state]
    for n in range(60):
        controller.step(n * controller.scenario.run.step, *MOTION)
        if n in (0, 59):
            found.append(controller.state)
    return found


def attack_python(chosen: argparse.Namespace) -> None:
    controllers = [fg.Controller(s, single_precision=single) for s in SCENARIOS for single in (False, True)]
    states = [states_of(controller) for controller in controllers]
    everyone = [state for all_of_one in states for state in all_of_one]
    notebook = Notebook(chosen.note)
    known = [(i, attempt) for attempt in corpus("states", "python") for i in range(len(controllers))]
    for index in indices(chosen):
        number = index % len(controllers)
        controller, prefix = controllers[number], states[number][0].index(b"\n") + 1
        if index < len(known):
            number, attempt = known[index]
            controller = controllers[number]
        else:
            attempt = payload(chosen.seed, index, prefix, states[number], everyone)
        notebook.note(attempt)
        before = controller.state
        try:
            controller.state = attempt
        except ValueError as error:
            refusal = str(error)
        else:
            refusal = ""
        if refusal:
            assert re.fullmatch("state .*", refusal), refusal
            assert controller.state == before
            assert attempt not in states[number], "what was saved was refused"
            continue
        assert not damaged(attempt, prefix), "damage was not noticed"
        for _ in range(3):
            controller.step(controller._core.steps * controller.scenario.run.step, *MOTION)
        assert len(controller.state) == len(before)
        assert controller.estimates is not None
        assert controller.status
    print(f"python: {index + 1} attempts")


BROWSER = """
import { readFileSync } from "node:fs";
const [folder] = process.argv.slice(1);
const { load } = await import(folder + "/fracgyro.mjs");
const json = (name) => JSON.parse(readFileSync(`${folder}/${name}`));
const fracgyro = await load({ wasm: readFileSync(folder + "/fracgyro.wasm"), data: json("fracgyro.json") });
const controllers = [];
for (const name of json("scenarios.json")) {
  for (const single of [false, true]) controllers.push(await fracgyro.controller(json(name), {}, { single }));
}
"""
SAVE = """
for (const controller of controllers) {
  const states = [controller.state];
  for (let n = 0; n < 60; ++n) {
    controller.step([0.5, 0.25], [0, 0.1]);
    if (n === 0 || n === 59) states.push(controller.state);
  }
  console.log(JSON.stringify(states.map((state) => Buffer.from(state).toString("base64"))));
}
"""
TRY = """
const all = readFileSync(folder + "/attempts");
let at = 0, index = 0;
const fail = (why) => { console.log(`${index}: ${why}`); process.exit(1); };
while (at < all.length) {
  const [number, size] = [all.readUInt32LE(at), all.readUInt32LE(at + 4)];
  const attempt = new Uint8Array(all.subarray(at + 8, at + 8 + size)), controller = controllers[number];
  at += 8 + size;
  const before = controller.state;
  try {
    controller.state = attempt;
  } catch (refusal) {
    if (!(refusal instanceof RangeError) || !/^state /.test(refusal.message)) fail(refusal.stack);
    if (Buffer.compare(before, controller.state)) fail("a refused state has changed something");
    ++index;
    continue;
  }
  try {
    if (controller.state.length !== before.length) fail("it has another size");
    for (let n = 0; n < 3; ++n) controller.step([0.5, 0.25], [0, 0.1]);
    controller.estimates;
  } catch (error) {
    fail(error.stack);
  }
  ++index;
}
"""


def node(code: str, folder: str) -> subprocess.CompletedProcess[str]:
    command = ["node", "--input-type=module", "-e", BROWSER + code, folder]
    return subprocess.run(command, capture_output=True, text=True)


def attack_browser(chosen: argparse.Namespace) -> None:
    import base64
    import json

    from fracgyro.export import web

    with tempfile.TemporaryDirectory() as folder:
        web.build(Path(folder))
        names = [f"{i}.json" for i in range(IN_BROWSER)]
        for name, scenario in zip(names, SCENARIOS, strict=False):
            web.export(scenario, Path(folder) / name)
        (Path(folder) / "scenarios.json").write_text(json.dumps(names))
        lines = node(SAVE, folder).stdout.splitlines()
        states = [[base64.b64decode(state) for state in json.loads(line)] for line in lines]
        everyone = [state for all_of_one in states for state in all_of_one]
        known = corpus("states", "browser")
        attempts: list[tuple[int, bytes]] = [(i, attempt) for attempt in known for i in range(len(states))]
        notebook, done = Notebook(chosen.note), 0
        for index in chain(indices(chosen), [None]):
            if index is not None:
                number = index % len(states)
                prefix = states[number][0].index(b"\n") + 1
                attempts.append((number, payload(chosen.seed, index, prefix, states[number], everyone)))
                if len(attempts) < 5000:  # to one process of node
                    continue
            packed = b"".join(struct.pack("<II", i, len(attempt)) + attempt for i, attempt in attempts)
            (Path(folder) / "attempts").write_bytes(packed)
            ran = node(TRY, folder)
            if ran.returncode:
                failed, _, why = ran.stdout.partition(":")
                notebook.note(attempts[int(failed)][1])
                raise AssertionError(why + ran.stderr)
            done += len(attempts)
            attempts.clear()
    print(f"browser: {done} attempts")


ATTACKS = {"python": attack_python, "browser": attack_browser}


def main() -> int:
    chosen = arguments(list(ATTACKS))
    if chosen.note:
        ATTACKS[chosen.face[0]](chosen)
        return 0
    with tempfile.TemporaryDirectory() as folder:
        ends = [watched("states", face, chosen, folder) for face in chosen.face or ATTACKS]
    return 0 if all(ends) else 1


if __name__ == "__main__":
    sys.exit(main())
