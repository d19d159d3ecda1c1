"""Refusals inside the process of a law: files, network, processes, signals, access to the memory."""

from __future__ import annotations

import os
import sys
from typing import Any, NoReturn

WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
# Audit events (docs.python.org/3/library/audit_events.html) by the start of their names, and the sentence.
FILES = "a law must not write files"
FORBIDDEN = {
    "socket.": "it opened a socket; a law must not use the network",
    "subprocess.": "it started a process; a law must not",
    "os.system": "it started a process; a law must not",
    "os.exec": "it started a process; a law must not",
    "os.fork": "it started a process; a law must not",
    "os.posix_spawn": "it started a process; a law must not",
    "os.spawn": "it started a process; a law must not",
    "os.kill": "it sent a signal; a law must not",
    "resource.setrlimit": "it changed a limit of its process; a law must not",
    "gc.get_": "it searched the memory of its process; a law must not look for seeds",
    **{
        f"os.{name}": f"it changed files (os.{name}); {FILES}"
        for name in ("mkdir", "remove", "rename", "rmdir", "link", "symlink", "truncate", "chmod", "chown", "utime")
    },
    "shutil.": f"it changed files; {FILES}",
    "tempfile.": f"it made a temporary file; {FILES}",
}


class NotAllowed(PermissionError):
    """A law did what it must not."""


class Guard:
    """Refuses events from `arm` on, and remembers the first: a law may catch the exception."""

    def __init__(self) -> None:
        self.first = ""
        self._armed = False
        sys.addaudithook(self._event)

    def arm(self) -> None:
        self._armed = True

    def disarm(self) -> None:
        self._armed = False

    def _event(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self._armed:
            return
        if event == "open":
            path, mode, flags = arguments
            if (isinstance(mode, str) and set(mode) & set("wax+")) or (isinstance(flags, int) and flags & WRITES):
                self._refuse(f"it opened {path} for writing; {FILES}")
            return
        for start, sentence in FORBIDDEN.items():
            if event.startswith(start):
                self._refuse(sentence)

    def _refuse(self, sentence: str) -> NoReturn:
        self.first = self.first or sentence
        raise NotAllowed(sentence)
