# make reproduce   run the paper's study, into out/report.html; LOCKED=1, in a fresh clone: with the libraries of
#                  requirements.lock
# make test        run every check and every test
# make test-quick  run the tests that fail most often after a change, in less than a minute
# make test-nightly     run the tests that `make test` leaves out: other cases of what it tests once, and slow ones
# make test-machines    run every test as on other processors, with other compilers and Pythons: for a release
# make web         build the WebAssembly module and the live page, into build/web
# make live        open the live page in the browser
# make lint        run the checks that need neither a compiler nor the installed module; list outdated logs
# make cpp-test    build and run one C++ test: TEST=guard is tests/cpp/test_guard.cpp
# make bench       regenerate all logs that docs/performance.md and others quote; takes most of a day.
#                  ARGS="rate_sensor": only some
# make bench-behind     regenerate only the logs that are older than their sources
# make logs-current     fail if a log is older than its sources
# make pages       update the numbers of README.md and docs/ from the logs
# make compare     compare the controllers, in full; into benchmarks/results/compare_*.md
# make zoo         run the published laws of the zoo, in full; into benchmarks/results/zoo.md
# make board       write the page of the board, build/board/index.html, from the entries in lab/board
# make article     typeset the replication article; into build/article/article.pdf
# make docs        build the documentation site, into build/site
# make wheel       build sdist and wheel and test them in a clean environment; into dist
# make lock        update requirements.lock: the newest libraries that `make reproduce` may have, with their hashes
# make mutants     mutate the code and count the mutants that the tests detect; into benchmarks/results/mutants.md
# make check-deep  run the slow checks, ten minutes: fuzzing files, folders, the command line, states, FMUs, firmware;
#                  clang-tidy
# make setup-embedded   install compilers, emulator and node, from Debian's packages; without them the tests of firmware
#                  or browser are skipped. The other targets setup-* install:
# make setup-browser    Chromium, from Debian's packages; without it the tests of pages in a browser are skipped
# make setup-fpga       Verilator, from Debian's packages; without it the tests of exported hardware are skipped
# make setup-postgres   a database server, from Debian's packages; without it the test of a shared database is skipped
# make setup-octave     Octave and its MEX compiler, from Debian's packages; without them the tests of MATLAB's class
#                  are skipped
# make check-sanitized  test the core, FMUs, the Python module and parallel runs under the sanitizers
# Partial targets: built, check, test-core, test-python, setup-test; also clean. ARGS="..." is passed to reproduce.

PYTHON ?= python3
BIN := .venv/bin
# Processors available to this process; more than eight workers do not help.
WORKERS := $(shell n=$$(nproc 2>/dev/null || echo 2); echo $$((n < 8 ? n : 8)))
# With address randomization, the sanitizers of some compilers fail on some kernels.
FIXED := $(shell setarch -R true 2>/dev/null && echo setarch -R)
CTEST := $(FIXED) $(BIN)/ctest --output-on-failure -j $(WORKERS) --test-dir build
# The slowest tests are listed: they are worth a look before others. BLAS's threads of several processes would wait for
# each other.
PYTEST := OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n $(WORKERS) --dist worksteal --durations=25 --durations-min=1
CPP := $(shell find include bindings integrations fpga examples tests benchmarks -name '*.[ch]pp' 2>/dev/null)
BUILT_FROM := pyproject.toml CMakeLists.txt bindings/stub.pat $(filter include/% bindings/%,$(CPP)) \
  $(shell find integrations -type f)
NINJA := -DCMAKE_MAKE_PROGRAM="$(CURDIR)/$(BIN)/ninja"
# CMake's own variable: with ccache installed, unchanged files are not compiled again.
export CMAKE_CXX_COMPILER_LAUNCHER ?= $(shell command -v ccache)
# Tests start many processes: without Python's compiled files each would compile again what it imports.
unexport PYTHONDONTWRITEBYTECODE
SUDO = $(shell [ "$$(id -u)" = 0 ] || command -v sudo)

.PHONY: reproduce built test test-quick test-nightly test-machines lint check cpp-test check-deep check-sanitized \
  fuzz-firmware mutants test-core test-python web live bench bench-behind logs-current pages compare zoo board article \
  docs wheel lock setup-test setup-embedded setup-browser setup-fpga setup-postgres setup-octave setup-machines clean
.SECONDARY:
.NOTPARALLEL:  # pip cannot run in parallel; compilers and tests use all processors anyway

COMMA := ,
DRAWN := netcdf,report
reproduce: .venv/installed-$(if $(LOCKED),locked,$(DRAWN))
	$(BIN)/fracgyro reproduce $(ARGS)

# Everything that the tests need. Compilation starts while packages download. A failure here is repeated, with its
# reason, by the target that needs the result.
built: .venv/tools setup-test
	@export CMAKE_BUILD_PARALLEL_LEVEL=$(WORKERS); $(MAKE) --no-print-directory .venv/installed-test & \
	  $(MAKE) --no-print-directory --keep-going build/tests-optimized/built build/tests-sanitized/built; wait

# The checks use one processor: they run during the tests, and print their findings when they end.
test: built .venv/installed-test
	@mkdir -p build
	@{ checked=0; $(MAKE) --no-print-directory check >build/check.log 2>&1 || checked=$$?; \
	  cat build/check.log; exit $$checked; } & check=$$!; failed=0; \
	  $(MAKE) --no-print-directory --keep-going test-core test-python || failed=$$?; \
	  wait $$check || failed=$$?; exit $$failed
	@echo "All checks and tests passed."

# Tests without processes, compilers and reports: less than a minute on two cores if everything is built.
QUICK := composite device documents fractional full_history kernel lanes layers loop rate_figures repository scenario \
  settings study
test-quick: check build/tests-optimized/built
	$(CTEST)/tests-optimized
	$(PYTEST) $(QUICK:%=tests/python/test_%.py)

test-machines:
	tests/machines.sh

lint: .venv/lint
	$(BIN)/ruff check --quiet --output-format concise
	$(BIN)/ruff format --check --quiet
	$(BIN)/clang-format --dry-run -Werror $(CPP)
	$(BIN)/python -m pytest -q --noconftest -p no:cacheprovider tests/python/test_text.py
	$(BIN)/python benchmarks/pages.py --check
	$(BIN)/python benchmarks/sources.py
	$(BIN)/python tests/english.py

logs-current: $(BIN)/pip
	$(BIN)/python benchmarks/sources.py --check

# The lint runs first: its findings need no compiler.
check: lint .venv/installed-test
	$(BIN)/mypy --no-error-summary

test-core: build/tests-optimized/built build/tests-sanitized/built
	$(CTEST)/tests-optimized
	$(CTEST)/tests-sanitized

test-python: .venv/installed-test
	$(PYTEST)

test-nightly: .venv/installed-test
	$(PYTEST) -m nightly

# Quickly compiled, and without copies for processors.
cpp-test: .venv/tools setup-test
	$(BIN)/cmake --preset dev $(NINJA) >/dev/null
	$(BIN)/cmake --build build/dev --target test_$(TEST) -- --quiet
	$(FIXED) build/dev/tests/cpp/test_$(TEST) --gtest_brief=1 $(ARGS)

web: .venv/installed-export
	$(BIN)/python -m fracgyro.export.live build/web

live: .venv/installed-export
	$(BIN)/fracgyro live paper

bench: .venv/installed-bench .venv/installed-export .venv/installed-mutants
	$(BIN)/python benchmarks/bench.py $(ARGS)
	$(BIN)/python benchmarks/pages.py

bench-behind: .venv/installed-bench .venv/installed-export .venv/installed-mutants
	$(BIN)/python benchmarks/bench.py --behind
	$(BIN)/python benchmarks/pages.py

pages: $(BIN)/pip
	$(BIN)/python benchmarks/pages.py

wheel:
	PYTHON=$(PYTHON) tests/wheel.sh

# For every system and Python, including the build requirements.
REQUIRES := import tomllib; print(*tomllib.load(open("pyproject.toml", "rb"))["build-system"]["requires"], sep="\n")
lock: $(BIN)/pip
	$(BIN)/pip install --quiet --disable-pip-version-check uv
	{ $(BIN)/python -c '$(REQUIRES)'; printf 'cmake\nninja\n'; } | $(BIN)/uv pip compile --quiet --upgrade --universal \
	  --fork-strategy fewest --python-version 3.11 --generate-hashes --no-annotate --no-header \
	  $(patsubst %,--extra %,$(subst $(COMMA), ,$(DRAWN))) --output-file requirements.lock pyproject.toml -

# Resumes the results in build/compare. ARGS="track": only that task. ARGS="--quick": the logs are marked as untuned.
compare: .venv/installed-test
	$(BIN)/python lab/compare.py $(ARGS)

# Resumes the results in build/zoo. ARGS="--quick": the log is marked as untuned.
zoo: .venv/installed-test
	$(BIN)/python lab/zoo.py $(ARGS)

# The entries are made by `fracgyro enter`; no law runs here.
board: .venv/installed-test
	$(BIN)/python -m fracgyro_lab.board lab/board build/board benchmarks/results/flops.md

# Takes half a minute for its own runs. ARGS="--seeds 8": fewer noise seeds than the study's 100.
article: .venv/installed-article
	$(BIN)/python lab/article/build.py $(ARGS)

# Runs the gallery's scripts, and includes the live page.
SPHINX = $(BIN)/sphinx-build -c docs/site -d build/site-doctrees -W --keep-going -q -j auto
docs: .venv/installed-docs
	$(BIN)/python docs/site/pages.py build/site-source
	{ $(BIN)/python -m fracgyro.export.live build/web && \
	  $(BIN)/python -m fracgyro_lab.board lab/board build/web/board benchmarks/results/flops.md; } & pages=$$!; \
	  $(SPHINX) -b html build/site-source build/site && wait $$pages && cp -r build/web/live build/web/board build/site/

# Random inputs: every one must work or be refused in one sentence. One line per fuzzer.
FUZZ_SECONDS := 40
FUZZ_SEED := 1
FUZZERS = $(wildcard tests/fuzz/fuzz_*.py)
check-deep: .venv/installed-test fuzz-firmware
	@failed=; for fuzzer in $(FUZZERS); do \
	  $(BIN)/python $$fuzzer --seconds $(FUZZ_SECONDS) --seed $(FUZZ_SEED) || failed="$$failed $$fuzzer"; done; \
	  [ -z "$$failed" ] || { echo "Failed:$$failed"; exit 1; }

# The firmware of a scenario with a force limit, which the fuzzer relies on, and with samples checked. libFuzzer reads
# one file per input; a line of corpus.jsonl is one, as hexadecimal digits.
define UNPACK
import json, pathlib
for number, line in enumerate(open("tests/firmware/corpus.jsonl")):
    pathlib.Path(f"build/fuzz/corpus/{number}").write_bytes(bytes.fromhex(json.loads(line)))
endef
export UNPACK
FUZZED := build/fuzz/firmware
fuzz-firmware: .venv/installed-test
	rm -rf $(FUZZED) build/fuzz/corpus && mkdir -p build/fuzz/found build/fuzz/corpus
	$(BIN)/python -c "$$UNPACK"
	$(BIN)/fracgyro scenario paper | sed -e 's/^force_limit = .*/force_limit = 1000.0/' \
	  -e 's/^switching_limit = .*/switching_limit = 0.5/' -e 's/^checked = .*/checked = true/' > build/fuzz/limited.toml
	$(BIN)/fracgyro export firmware build/fuzz/limited.toml --out $(FUZZED)
	cd $(FUZZED) && clang-tidy --quiet fracgyro.cpp -- -std=c++20 -I. -Iinclude
	clang++ -std=c++20 -O1 -g1 -fsanitize=fuzzer,address,undefined,float-cast-overflow -fno-sanitize-recover=all \
	  -ffp-contract=off -I$(FUZZED) -I$(FUZZED)/include $(FUZZED)/fracgyro.cpp tests/firmware/fuzz.cpp -o build/fuzz/fuzz
	cd build/fuzz && ./fuzz -max_total_time=$(FUZZ_SECONDS) -max_len=256 -verbosity=0 -print_final_stats=1 \
	  found corpus

# The C++ tests, the Python module and FMUs under AddressSanitizer and UndefinedBehaviorSanitizer, many runs under
# ThreadSanitizer.
# This module takes precedence over the editable one, because -S skips the site packages that point to it.
SANITIZERS := address,undefined,float-cast-overflow
SANITIZED := build/sanitized
SANITIZED_SECONDS := 20
UNDER_SANITIZERS = ASAN_OPTIONS=detect_leaks=0 \
  LD_PRELOAD="$$($(CXX) -print-file-name=libasan.so) $$($(CXX) -print-file-name=libstdc++.so)" \
  PYTHONPATH=$(SANITIZED)/python:$$($(BIN)/python -c "import sysconfig; print(sysconfig.get_path('purelib'))")
check-sanitized: .venv/installed-test $(SANITIZED)/built build/tests-deep/built build/tests-threads/built
	$(CTEST)/tests-deep
	$(BIN)/ctest --test-dir build/tests-threads --tests-regex batch --output-on-failure
	$(UNDER_SANITIZERS) $(BIN)/python -S -m pytest -p no:cacheprovider tests/python/test_state.py -k "not no_bytes"
	$(UNDER_SANITIZERS) $(BIN)/python -S tests/fuzz/fuzz_states.py --face python --seconds $(SANITIZED_SECONDS)
	$(UNDER_SANITIZERS) CXX="$(CXX) -fsanitize=$(SANITIZERS) -fno-sanitize-recover=all" \
	  $(BIN)/python -S tests/fuzz/fuzz_fmu.py --seconds $(SANITIZED_SECONDS)

$(SANITIZED)/built: $(BUILT_FROM) | .venv/installed-test
	rm -rf $(SANITIZED)/python
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --target $(SANITIZED)/python \
	  -C build-dir=$(SANITIZED)/cmake -C cmake.define.CMAKE_CXX_FLAGS_RELEASE="-O1 -g1" \
	  -C cmake.define.FRACGYRO_SANITIZE=$(SANITIZERS) .
	@touch $@

# Takes under half an hour on two cores. Its parts: ARGS="check", ARGS="cpp", ARGS="python", ARGS="log".
mutants: .venv/installed-mutants setup-test
	$(BIN)/python tests/mutants/run.py $(ARGS)

EMBEDDED := gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm clang clang-tidy \
  libclang-rt-dev nodejs
setup-embedded:
	@{ dpkg -s $(EMBEDDED) >/dev/null 2>&1; } \
	  || { $(SUDO) apt-get -qq update && $(SUDO) apt-get -qq install -y --no-install-recommends $(EMBEDDED); }

# Browser for the tests of pages.
setup-browser:
	@command -v chromium >/dev/null \
	  || { $(SUDO) apt-get -qq update && $(SUDO) apt-get -qq install -y --no-install-recommends chromium; }

# Simulator of exported hardware.
setup-fpga:
	@command -v verilator >/dev/null \
	  || { $(SUDO) apt-get -qq update && $(SUDO) apt-get -qq install -y --no-install-recommends verilator; }

# Server for the test of a shared database.
setup-postgres:
	@ls /usr/lib/postgresql/*/bin/initdb >/dev/null 2>&1 \
	  || { $(SUDO) apt-get -qq update && $(SUDO) apt-get -qq install -y --no-install-recommends postgresql; }

# Octave, for the tests of MATLAB's class. Most of its 370 MB are plotting libraries that the package requires.
setup-octave:
	@command -v mkoctfile >/dev/null \
	  || { $(SUDO) apt-get -qq update && $(SUDO) apt-get -qq install -y --no-install-recommends octave octave-dev; }

# GoogleTest, from Debian's packages if it is missing and installing needs no password; else CMake downloads it.
setup-test:
	@echo '#include <gtest/gtest.h>' | $(CXX) -E -x c++ - >/dev/null 2>&1 || { \
	  [ "$$(id -u)" = 0 ] && as_root= || as_root='sudo -n'; \
	  $$as_root apt-get -qq update && $$as_root apt-get -qq install -y --no-install-recommends libgtest-dev; \
	  } >/dev/null 2>&1 || true

# Emulator of other processors (tests/machines.sh).
setup-machines:
	@command -v qemu-x86_64 >/dev/null \
	  || { $(SUDO) apt-get -qq update && $(SUDO) apt-get -qq install -y --no-install-recommends qemu-user; }

clean:
	rm -rf .venv build out .hypothesis .mypy_cache .pytest_cache .ruff_cache

# Editable: only C++ sources need a new installation.
$(BIN)/pip:
	@$(PYTHON) -c "$$NEWER"
	@$(PYTHON) -m venv .venv \
	  || { rm -rf .venv; echo "Python's venv is missing: install it, on Debian as python3-venv"; exit 1; }

.venv/compiler: | $(BIN)/pip
	@$(PYTHON) -c "$$COMPILER"
	@touch $@

define NEWER
import sys
if sys.version_info < (3, 11):
    sys.exit(f"Python 3.11 or newer is needed, not {sys.version.split()[0]}: name one, as in make PYTHON=python3.13")
endef
export NEWER

define COMPILER
import os, shutil, sys, sysconfig
if not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")):
    sys.exit("Python's headers are missing: install them, on Debian as python3-dev")
if not shutil.which(os.environ.get("CXX", "c++").split()[0]):
    sys.exit("A C++20 compiler is missing: install one, on Debian as g++, or name it, as in make CXX=clang++")
endef
export COMPILER

# Libraries of an extra, without the module.
LIBRARIES := import sys, tomllib; project = tomllib.load(open("pyproject.toml", "rb"))["project"]; \
  print(*project["optional-dependencies"][sys.argv[1]], sep="\n")
LIBRARIES_OF = $(BIN)/python -c '$(LIBRARIES)' $1 \
  | $(BIN)/pip install --quiet --disable-pip-version-check --requirement /dev/stdin
.venv/lint: pyproject.toml | $(BIN)/pip
	@$(call LIBRARIES_OF,lint)
	@touch $@

# Tools that compile the module and the C++ tests.
.venv/tools: pyproject.toml | .venv/compiler
	@$(call LIBRARIES_OF,dev)
	@touch $@

# No bytecode is compiled at installation, since most modules are never imported. The extra `test` includes other
# extras, which then need no new build.
OF_TESTS := $(patsubst %,.venv/installed-%,$(DRAWN) export article docs)
.venv/installed-%: $(BUILT_FROM) | .venv/tools
	$(BIN)/pip install --quiet --disable-pip-version-check --no-compile --no-build-isolation --editable ".[$*]"
	@touch $@ $(if $(filter test,$*),$(OF_TESTS))

.venv/installed-locked: requirements.lock $(BUILT_FROM) | .venv/compiler
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes --only-binary :all: --requirement $<
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

# The C++ tests, some under the sanitizers (tests/cpp/CMakeLists.txt); build/tests-deep: all under the sanitizers.
# Warnings are shown; in .ci/run they are errors.
build/tests-optimized/built: OPTIONS := -DFRACGYRO_TESTS_ONLY=optimized
build/tests-sanitized/built: OPTIONS := -DFRACGYRO_SANITIZE=$(SANITIZERS),float-divide-by-zero \
  -DFRACGYRO_TESTS_ONLY=sanitized
build/tests-deep/built: OPTIONS := -DFRACGYRO_SANITIZE=$(SANITIZERS),float-divide-by-zero
build/tests-threads/built: OPTIONS := -DFRACGYRO_SANITIZE=thread
build/tests-threads/built: BUILD := --target test_batch
build/tests-%/built: $(CPP) CMakeLists.txt tests/cpp/CMakeLists.txt | .venv/tools setup-test
	$(BIN)/cmake -S . -B $(@D) -G Ninja $(NINJA) \
	  -DFRACGYRO_PYTHON=OFF -DFRACGYRO_TESTS=ON $(OPTIONS) \
	  -DFRACGYRO_WARNINGS_AS_ERRORS=$(if $(FRACGYRO_SKIP_NOTHING),ON,OFF) >/dev/null
	$(BIN)/cmake --build $(@D) $(BUILD) -- --quiet
	@! ls $(@D)/tests/cpp/test_* >/dev/null 2>&1 || touch $@
