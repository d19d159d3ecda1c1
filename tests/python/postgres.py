"""A PostgreSQL server for a single test, from Debian's package."""

from __future__ import annotations

import glob
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from children import PATIENCE
from embedded import STRICT

USER = "fracgyro"


@contextmanager
def postgres() -> Iterator[str]:
    """Its address for SQLAlchemy. Skip the test if it is missing, unless nothing may be skipped."""
    programs = [Path(found).parent for found in sorted(glob.glob("/usr/lib/postgresql/*/bin/initdb"))]
    if not programs:
        reason = "target PostgreSQL: its server is missing, which `make setup-postgres` installs"
        if STRICT:
            pytest.fail(reason)
        pytest.skip(reason)
    # The server refuses to run as root, and pytest's folders are closed to others; the path of a socket is short.
    folder = Path(tempfile.mkdtemp(prefix="pg"))
    run_as = []
    if os.geteuid() == 0:
        run_as = ["setpriv", "--reuid=postgres", "--regid=postgres", "--clear-groups"]
        shutil.chown(folder, "postgres", "postgres")
    data = folder / "data"
    make = [programs[-1] / "initdb", "--pgdata", data, "--username", USER, "--auth", "trust", "--no-sync", "-E", "UTF8"]
    serve = [programs[-1] / "postgres", "-D", data, "-k", folder, "-c", "listen_addresses=", "-c", "fsync=off"]
    server = None
    try:
        made = subprocess.run([*run_as, *make], capture_output=True, text=True, timeout=PATIENCE, cwd=folder)
        assert made.returncode == 0, made.stderr
        server = subprocess.Popen([*run_as, *serve], stderr=subprocess.PIPE, text=True, cwd=folder)
        assert server.stderr is not None
        said = []
        while not (said and "ready to accept connections" in said[-1]):
            said.append(server.stderr.readline())
            assert said[-1], f"the server ended: {''.join(said)}"
        yield f"postgresql+psycopg://{USER}@/postgres?host={folder}"
    finally:
        if server is not None:
            server.send_signal(signal.SIGINT)  # its fast shutdown
            server.communicate(timeout=PATIENCE)
        shutil.rmtree(folder, ignore_errors=True)
