#!/usr/bin/env bash
# `make test` in settings that emulate other machines, as far as possible here: one line for each setting.
#
#     tests/machines.sh                    every setting, which takes hours on two cores
#     tests/machines.sh haswell clang      these
#
# Compilers and Pythons are tested in copies under build/machines/, which also has the logs. Settings unavailable on
# this machine are skipped and listed. Fails if a setting fails.
set -uo pipefail
cd "$(dirname "$0")/.."
out=$PWD/build/machines
mkdir -p "$out"

# CPU features that NumPy can disable here, from the newest processors down.
numpy_features() {
  .venv/bin/python - "$@" <<'PYTHON'
import sys
from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__
there = [name for name in __cpu_dispatch__ if __cpu_features__[name]]
print(*(name for name in there if name.startswith(tuple(sys.argv[1:] or [""]))))
PYTHON
}

lacking() {
  echo "this machine lacks $1"
  exit 77
}

processor() {  # OpenBLAS's name, features that glibc goes without, prefixes of those that NumPy does: all by default
  local blas=$1 libc=$2
  shift 2
  export OPENBLAS_CORETYPE=$blas GLIBC_TUNABLES=glibc.cpu.hwcaps=$libc
  NPY_DISABLE_CPU_FEATURES=$(numpy_features "$@") make test
}

copy() {  # the working tree, including uncommitted files, with a separate build
  rm -rf "$out/$1" && mkdir -p "$out/$1"
  git ls-files -z --cached --others --exclude-standard | xargs -0 cp --parents -t "$out/$1"
  cd "$out/$1" && git init -q
}

# Emulated by instruction, 60 times slower: the tests of numbers and lanes, and the package's results.
emulated() {
  command -v qemu-x86_64 >/dev/null || lacking "qemu-x86_64, which \`make setup-machines\` installs"
  local test run="-m fracgyro simulate --set run.duration=2.0 --json"
  for test in build/tests-optimized/tests/cpp/test_*; do
    [ ! -x "$test" ] || [ ! -f "$test" ] || qemu-x86_64 -cpu "$1" "$test" --gtest_brief=1 || return 1
  done
  cmp <(.venv/bin/python $run) <(qemu-x86_64 -cpu "$1" .venv/bin/python $run)
}

python() {
  local found=python$1  # may exist without working
  "$found" -c "" 2>/dev/null || found=$(compgen -G "$HOME/.pyenv/versions/$1.*/bin/python" | tail -1)
  [ -n "$found" ] || lacking "Python $1"
  copy "python$1" && make PYTHON="$found" test
}

with_clang() {
  command -v clang++ >/dev/null || lacking "clang++, which \`make setup-embedded\` installs"
  copy clang && make CC=clang CXX=clang++ test
}

setting() {
  case $1 in
    here) make test ;;
    zen) processor Zen -AVX512F AVX512 X86_V4 ;;
    haswell) processor Haswell -AVX512F AVX512 X86_V4 ;;
    skylakex) processor SkylakeX "" AVX512_ ;;
    nehalem) processor Nehalem -AVX2,-FMA,-AVX512F ;;
    emulated-nehalem) emulated Nehalem ;;
    emulated-haswell) emulated Haswell ;;
    one-core) taskset -c "$(taskset -cp $$ | sed 's/.*: \([0-9]*\).*/\1/')" make test ;;
    crowded) make WORKERS="$(($(nproc) * 4))" test-python ;;
    clang) with_clang ;;
    python*) python "${1#python}" ;;
    spaces) copy "a folder" && make test ;;
    *) echo "no such setting" && return 1 ;;
  esac
}

all="here zen haswell skylakex nehalem emulated-nehalem emulated-haswell one-core crowded clang
  python3.11 python3.12 python3.13 python3.14 spaces"
[ $# -gt 0 ] || set -- $all

make .venv/installed-test build/tests-optimized/built || exit 1
failed=0
for name in "$@"; do
  begin=$SECONDS
  (setting "$name") >"$out/$name.log" 2>&1
  case $? in
    0) verdict=$(grep -E '^(=* )?[0-9]+ passed' "$out/$name.log" | tail -1 | tr -d =) ;;
    77) verdict="skipped: $(tail -1 "$out/$name.log")" ;;
    *) failed=1 verdict="FAILED: $(grep -E '^(FAILED|ERROR|make: )' "$out/$name.log" | head -1)" ;;
  esac
  printf '%-18s %5d s  %s\n' "$name" $((SECONDS - begin)) "${verdict:-ok}"
done
exit $failed
