"""`python -m fracgyro_lab.board ENTRIES OUT [OPERATIONS]` writes the page, for `make board`."""

import sys
from pathlib import Path

from .page import write_page

if __name__ == "__main__":
    folder, out, *operations = map(Path, sys.argv[1:])
    count = write_page(folder, out, *operations)
    print(f"{count} entries: {out / 'index.html'}")
