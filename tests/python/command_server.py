"""Commands `fracgyro` in separate processes, which take over the imports of one server instead of repeating them."""

from __future__ import annotations

import json
import select
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

from children import PATIENCE

# Forks a process for each line of its input, whose arguments, folder and files the line names, and prints the exit
# code. The process is what `python -m fracgyro` is after its imports.
SERVER = """
import json, os, sys, traceback
import fracgyro.analysis.metrics, fracgyro.simulation.simulate, rich.console, rich.table
from fracgyro.cli import cli, main
from fracgyro.cli.main import COMMANDS

for name in COMMANDS:
    cli.get_command(None, name)
for line in sys.stdin:
    words, folder, output, errors = json.loads(line)
    child = os.fork()
    if not child:
        code = 1
        try:
            os.chdir(folder)
            for number, name, mode in ((0, os.devnull, "r"), (1, output, "w"), (2, errors, "w")):
                with open(name, mode) as file:
                    os.dup2(file.fileno(), number)
            sys.argv = ["fracgyro", *words]
            main()
        except SystemExit as stop:
            code = stop.code or 0
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@cache
def _server() -> subprocess.Popen[str]:
    """Ends with the process of the tests, which closes its input."""
    return subprocess.Popen(
        [sys.executable, "-c", SERVER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
    )


def fracgyro(*words: str | Path, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """`fracgyro WORDS` with its exit code and what it wrote."""
    server = _server()
    assert server.stdin is not None
    assert server.stdout is not None
    arguments = list(map(str, words))
    with tempfile.TemporaryDirectory() as name:
        files = [Path(name) / stream for stream in ("output", "errors")]
        server.stdin.write(json.dumps([arguments, str(cwd or Path.cwd()), *map(str, files)]) + "\n")
        server.stdin.flush()
        if not select.select([server.stdout], [], [], PATIENCE)[0]:
            server.kill()
        code = server.stdout.readline()
        assert code, f"{arguments} takes longer than {PATIENCE} s, or the server of commands has ended"
        output, errors = (file.read_text(encoding="utf-8", errors="surrogateescape") for file in files)
    return subprocess.CompletedProcess(arguments, int(code), output, errors)
