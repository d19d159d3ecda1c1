"""Saved states, in Python and in the browser's module; fuzz_fmu.py covers FMUs. Any bytes are refused in one sentence
or the controller continues from them: none crash it, and damaged ones are never accepted. The first byte of an input
selects the controller of the state.
"""

from __future__ import annotations

import base64
import json
import random
import re
import resource
import struct
import subprocess
import tempfile
import zlib
from functools import cache
from pathlib import Path

import fracgyro as fg
import harness
from fracgyro.export.web import build, web
from payloads import payload

PAPER = fg.Scenario.paper().replace({"run.duration": 2.0, "controller.switching_limit": 0.5})
SCENARIOS = [
    PAPER,
    PAPER.replace({"adaptation.kind": "composite", "controller.order": 0.5}),
    PAPER.replace({"adaptation.kind": "joint", "adaptation.covariance_steps": 3}),
    PAPER.replace({"controller.kind": "linear", "controller.force_limit": 1000.0}),
    PAPER.replace({"device.sensing": "position", "controller.derivative": "caputo"}),
]
MOTION = ([0.5, 0.25], [0.0, 0.1])
IN_BROWSER = 3  # among the scenarios: it has no observer


def made(rng: random.Random, states: list[list[bytes]]) -> bytes:
    number = rng.randrange(len(states))
    prefix = states[number][0].index(b"\n") + 1
    return bytes([number]) + payload(rng, prefix, states[number], [state for one in states for state in one])


# -- Python


@cache
def controllers() -> list[fg.Controller]:
    return [fg.Controller(s, single_precision=single) for s in SCENARIOS for single in (False, True)]


@cache
def states() -> list[list[bytes]]:
    """States of each at the start, after one sample and after many."""
    found = []
    for controller in controllers():
        saved = [controller.state]
        for n in range(60):
            controller.step(n * controller.scenario.run.step, *MOTION)
            if n in (0, 59):
                saved.append(controller.state)
        found.append(saved)
    return found


def make_python(rng: random.Random) -> bytes:
    return made(rng, states())


def check_python(case: bytes, _: Path) -> str:
    number, attempt = case[0], case[1:]
    controller, saved = controllers()[number], states()[number]
    controller.state = before = saved[-1]
    refusal = ""
    try:
        controller.state = attempt
    except ValueError as error:
        refusal = str(error)
    if refusal:
        assert re.fullmatch("state .*", refusal), refusal
        assert controller.state == before
        assert attempt not in saved, "what was saved was refused"
        return "refused"
    prefix = saved[0].index(b"\n") + 1
    checksum = struct.pack("<I", zlib.crc32(attempt[prefix + 4 :]))
    assert attempt[prefix : prefix + 4] == checksum, "damage was not noticed"
    for _ in range(3):
        controller.step(controller._core.steps * controller.scenario.run.step, *MOTION)
    assert len(controller.state) == len(before)
    assert controller.estimates is not None
    assert controller.status
    return "worked"


# -- The browser's module, in node: prints the states, then the result of each line, `number base64`.

BROWSER = """
import { readFileSync } from "node:fs";
import { createInterface } from "node:readline";
const [folder] = process.argv.slice(1);
const { load } = await import(folder + "/fracgyro.mjs");
const json = (name) => JSON.parse(readFileSync(`${folder}/${name}`));
const modules = await Promise.all(["fracgyro.wasm", "fracgyro-single.wasm"].map(
  (name) => load({ wasm: readFileSync(`${folder}/${name}`), data: json("fracgyro.json") })));
const controllers = [];
for (const name of json("scenarios.json")) {
  for (const module of modules) controllers.push(await module.controller(json(name)));
}
const all = [];
for (const controller of controllers) {
  const states = [controller.state];
  for (let n = 0; n < 60; ++n) {
    controller.step([0.5, 0.25], [0, 0.1]);
    if (n === 0 || n === 59) states.push(controller.state);
  }
  all.push(states.map((state) => Buffer.from(state).toString("base64")));
}
console.log(JSON.stringify(all));
const tried = (controller, attempt) => {
  const before = controller.state;
  try {
    controller.state = attempt;
  } catch (refusal) {
    if (!(refusal instanceof RangeError) || !/^state /.test(refusal.message)) throw refusal;
    if (Buffer.compare(before, controller.state)) throw new Error("a refused state has changed something");
    return "refused";
  }
  if (controller.state.length !== before.length) throw new Error("it has another size");
  for (let n = 0; n < 3; ++n) controller.step([0.5, 0.25], [0, 0.1]);
  controller.estimates;
  return "worked";
};
for await (const line of createInterface({ input: process.stdin })) {
  const [number, text] = line.split(" ");
  try {
    console.log(tried(controllers[number], new Uint8Array(Buffer.from(text, "base64"))));
  } catch (error) {
    console.log(JSON.stringify(error.stack));
  }
}
"""


class Browser:
    def __init__(self) -> None:
        folder = Path(tempfile.mkdtemp())
        build(folder)
        names = [f"{i}.json" for i in range(IN_BROWSER)]
        for name, scenario in zip(names, SCENARIOS, strict=False):
            web(scenario, folder / name)
        (folder / "scenarios.json").write_text(json.dumps(names))
        command = ["node", "--input-type=module", "-e", BROWSER, str(folder)]
        self._node = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.states = [[base64.b64decode(state) for state in one] for one in json.loads(self._line())]

    def _line(self) -> str:
        assert self._node.stdout
        return self._node.stdout.readline().strip()

    def tried(self, number: int, attempt: bytes) -> str:
        print(number, base64.b64encode(attempt).decode(), file=self._node.stdin, flush=True)
        return self._line()


@cache
def browser() -> Browser:
    return Browser()


def make_browser(rng: random.Random) -> bytes:
    return made(rng, browser().states)


def check_browser(case: bytes, _: Path) -> str:
    outcome = browser().tried(case[0], case[1:])
    assert outcome in ("worked", "refused"), outcome
    return outcome


if __name__ == "__main__":
    harness.main(
        {
            "python": harness.Face(make_python, check_python, states, resource.RLIM_INFINITY),
            "browser": harness.Face(make_browser, check_browser, browser, resource.RLIM_INFINITY),
        }
    )
