#!/usr/bin/env bash
# Test an installed package without its sources: a wheel, and the oldest supported libraries.
#
#     tests/installed.sh [PYTHON]     a Python that has fracgyro[all,test-wheel]
set -euo pipefail
tree=$(cd "$(dirname "$0")/.." && pwd)
python=$(command -v "${1:-python}")
room=$(mktemp -d)
trap 'rm -rf "$room"' EXIT
mkdir "$room/tests" "$room/docs"
cp -r "$tree/tests/python" "$room/tests/python"
cp -r "$tree/docs/gallery" "$room/docs/gallery"
cd "$room/tests/python"
"$python" -m pytest -q -n 2 -c "$tree/pyproject.toml" --rootdir "$room" -p no:cacheprovider \
  test_{composite,device,fractional,full_history,gallery,kernel,lanes,loop,metrics,rate_figures,scenario}.py
