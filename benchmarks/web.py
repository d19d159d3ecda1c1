"""The WebAssembly module: sizes, and a run of the paper's scenario in node; writes benchmarks/results/web.md."""

from __future__ import annotations

import gzip
import hashlib
import json
import statistics
import subprocess
import tempfile
from pathlib import Path

import fracgyro as fg
from fracgyro import _core
from fracgyro.export.web import build
from fracgyro.scenario.to_core import core_setup
from machine import machine, write

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode", "integrations/web/*"]

RUN = """
import { readFileSync } from "node:fs";
import { createHash } from "node:crypto";
const { load } = await import(process.argv[1] + "/fracgyro.mjs");
const read = (name) => readFileSync(process.argv[1] + "/" + name);
const start = performance.now();
const fracgyro = await load({ wasm: read("fracgyro.wasm"), data: JSON.parse(read("fracgyro.json")) });
const loading = performance.now() - start;
const times = [];
let run;
for (let i = 0; i < 30; ++i) {
  const begin = performance.now();
  run = await fracgyro.simulate(fracgyro.paper.corrected);
  times.push(performance.now() - begin);
}
console.log(JSON.stringify({ loading, times, hash: createHash("sha256").update(run.rows).digest("hex") }));
"""


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        build(folder)
        command = ["node", "--input-type=module", "-e", RUN, name]
        ran = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        sizes = [
            f"| {path.name} | {path.stat().st_size:,} | {len(gzip.compress(path.read_bytes(), mtime=0)):,} |"
            for path in sorted(folder.iterdir())
        ]
    node = subprocess.run(["node", "--version"], check=True, capture_output=True, text=True).stdout.strip()
    rows = _core.record_runs([core_setup(fg.Scenario.paper())], 1, 1)[0]
    same = hashlib.sha256(rows.tobytes()).hexdigest() == ran["hash"]
    lines = [
        "# The WebAssembly module",
        "",
        "Made by `python benchmarks/web.py`.",
        "",
        f"Machine: {machine('ziglang')}; node {node}.",
        "",
        "The paper's corrected scenario, 80,001 samples, every channel kept: "
        f"{ran['times'][0]:.0f} ms the first time, then {statistics.median(ran['times'][1:]):.0f} ms (median of "
        f"{len(ran['times']) - 1}, {min(ran['times'][1:]):.0f} to {max(ran['times'][1:]):.0f}). "
        f"Loading takes {ran['loading']:.0f} ms.",
        "",
        f"SHA-256 of its rows: `{ran['hash']}`, {'the same' if same else 'NOT THE SAME'} as that of those of "
        "`fracgyro.simulate`.",
        "",
        "| file | bytes | gzipped |",
        "|---|---|---|",
        *sizes,
    ]
    write("web", lines)


if __name__ == "__main__":
    main()
