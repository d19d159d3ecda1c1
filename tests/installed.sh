#!/usr/bin/env bash
# Tests of an installed package, away from its sources: of a wheel, and of the oldest libraries that it admits.
#
#     tests/installed.sh [PYTHON]     a Python that has fracgyro[all,test-wheel]
set -euo pipefail
tree=$(cd "$(dirname "$0")/.." && pwd)
python=$(command -v "${1:-python}")
room=$(mktemp -d)
trap 'rm -rf "$room"' EXIT
mkdir "$room/tests" && cp -r "$tree/tests/python" "$room/tests/python"
cd "$room"
"$python" -m pytest -q -n 2 -c "$tree/pyproject.toml" --rootdir "$room" -p no:cacheprovider \
  tests/python/test_{composite,device,fractional,full_history,kernel,lanes,loop,metrics,rate_figures,scenario}.py
