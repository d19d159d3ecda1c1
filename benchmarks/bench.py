"""Regenerate the logs, one after another, and list failures.

python benchmarks/bench.py               all
python benchmarks/bench.py --behind      those whose sources have changed since they were made
python benchmarks/bench.py rate_sensor   those named
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

from sources import ELSEWHERE, PARTS, ROOT, WITHOUT_LOG, behind, scripts


def name_of(log: str) -> str:
    return next((name for name, elsewhere in ELSEWHERE.items() if elsewhere == log), Path(log).stem)


def main() -> int:
    by_name = {name_of(log): path for log, path in scripts().items()}
    by_name |= {name: ROOT / f"benchmarks/{name}.py" for name in WITHOUT_LOG}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one or more of {', '.join(by_name)}")
    parser.add_argument("--behind", action="store_true", help="only logs behind their sources")
    options = parser.parse_args()
    if unknown := [name for name in options.names if name not in by_name]:
        parser.error(f"no log is called {unknown[0]}: names are {', '.join(by_name)}")
    late = {name_of(log) for log in behind()} if options.behind else by_name.keys()
    failed = []
    for name in options.names or by_name:
        if name not in late:
            continue
        script = by_name[name]
        part = [PARTS.get(name, name)] if list(by_name.values()).count(script) > 1 else []
        words = " ".join(["python", str(script.relative_to(ROOT)), *part])
        print(f"== {words}", flush=True)
        begin = time.perf_counter()
        if subprocess.run([sys.executable, script, *part], cwd=ROOT).returncode != 0:
            failed.append(words)
        print(f"== {time.perf_counter() - begin:.0f} s", flush=True)
    for words in failed:
        print(f"failed: {words}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
