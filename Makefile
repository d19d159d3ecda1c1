# make reproduce   the paper's study, into out/report.html
# make test        every check and every test
# make web         the WebAssembly module, into build/web
# make bench       the measurements that the README quotes
# make check-deep  what takes a minute longer: fuzzing the firmware, clang-tidy
# make setup-embedded   compilers and emulator and node, from Debian's packages; without them the tests of firmware or browser are skipped
# Parts of them: check, test-core, test-python, setup-test; and clean. ARGS="..." goes to reproduce.

PYTHON ?= python3
BIN := .venv/bin
CPP := $(shell find core sim bindings faces tests benchmarks -name '*.[ch]pp' 2>/dev/null)
BUILT_FROM := pyproject.toml CMakeLists.txt $(filter core/% sim/% bindings/%,$(CPP)) $(shell find faces -type f)
SUDO = $(shell [ "$$(id -u)" = 0 ] || command -v sudo)

.PHONY: reproduce test check check-deep test-core test-python web bench setup-test setup-embedded clean
.SECONDARY:

reproduce: .venv/installed
	$(BIN)/fracgyro reproduce $(ARGS)

test:
	@$(MAKE) --no-print-directory --keep-going check test-core test-python
	@echo "All checks and tests passed."

check: .venv/installed-test build/tests-plain/built
	$(BIN)/ruff check --quiet --output-format concise
	$(BIN)/ruff format --check --quiet
	$(BIN)/mypy --no-error-summary
	$(BIN)/clang-format --dry-run -Werror $(CPP)

test-core: build/tests-plain/built build/tests-sanitized/built
	$(BIN)/ctest --test-dir build/tests-plain --output-on-failure
	$(BIN)/ctest --test-dir build/tests-sanitized --output-on-failure

test-python: .venv/installed-test
	$(BIN)/pytest -n auto

web: .venv/installed-export
	$(BIN)/python -m fracgyro.export.web build/web

bench: .venv/installed-bench .venv/installed-export
	$(BIN)/python benchmarks/operator_accuracy.py
	$(BIN)/python benchmarks/loop.py
	$(BIN)/python benchmarks/scaling.py
	$(BIN)/python benchmarks/reproduction.py
	$(BIN)/python benchmarks/best_order.py
	$(BIN)/python benchmarks/rate_estimation.py
	$(BIN)/python benchmarks/rate_response.py
	$(BIN)/python benchmarks/rate_sensor.py
	$(BIN)/python benchmarks/resonance_gains.py
	$(BIN)/python benchmarks/web.py
	$(BIN)/python benchmarks/parity.py
	$(BIN)/python benchmarks/firmware.py

# The firmware of a scenario with a force limit, which the fuzzer relies on.
FUZZED := build/fuzz/firmware
FUZZ_SECONDS := 60
check-deep: .venv/installed-test
	rm -rf $(FUZZED) && mkdir -p build/fuzz/found
	$(BIN)/fracgyro scenario paper | sed 's/^force_limit = .*/force_limit = 1000.0/' > build/fuzz/limited.toml
	$(BIN)/fracgyro export firmware build/fuzz/limited.toml --out $(FUZZED)
	cd $(FUZZED) && clang-tidy --quiet fracgyro.cpp -- -std=c++20 -I. -Icore
	clang++ -std=c++20 -O1 -g1 -fsanitize=fuzzer,address,undefined,float-cast-overflow -fno-sanitize-recover=all \
	  -ffp-contract=off -I$(FUZZED) -I$(FUZZED)/core $(FUZZED)/fracgyro.cpp tests/firmware/fuzz.cpp -o build/fuzz/fuzz
	cd build/fuzz && ./fuzz -max_total_time=$(FUZZ_SECONDS) -max_len=256 -verbosity=0 -print_final_stats=1 \
	  found ../../tests/firmware/corpus

EMBEDDED := gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm clang clang-tidy \
  libclang-rt-dev nodejs
setup-embedded:
	@{ dpkg -s $(EMBEDDED) >/dev/null 2>&1; } \
	  || { $(SUDO) apt-get -qq update && $(SUDO) apt-get -qq install -y --no-install-recommends $(EMBEDDED); }

# GoogleTest, from Debian's packages where it is missing.
setup-test:
	@echo '#include <gtest/gtest.h>' | $(CXX) -E -x c++ - >/dev/null 2>&1 \
	  || { $(SUDO) apt-get -qq update && $(SUDO) apt-get -qq install -y --no-install-recommends libgtest-dev; } \
	  || { echo "GoogleTest is missing: install it, on Debian as libgtest-dev"; exit 1; }

clean:
	rm -rf .venv build out .hypothesis .mypy_cache .pytest_cache .ruff_cache

# Editable: only C++ sources need a new installation.
$(BIN)/pip:
	$(PYTHON) -m venv .venv

.venv/installed: $(BUILT_FROM) | $(BIN)/pip
	$(BIN)/pip install --quiet --disable-pip-version-check --editable .
	@touch $@

.venv/installed-%: $(BUILT_FROM) | $(BIN)/pip
	$(BIN)/pip install --quiet --disable-pip-version-check --editable ".[$*]"
	@touch .venv/installed $@

# The C++ tests, with warnings as errors: once as shipped, once under the sanitizers.
build/tests-sanitized/built: OPTIONS := -DFRACGYRO_SANITIZE=ON
build/tests-%/built: $(CPP) CMakeLists.txt tests/core/CMakeLists.txt | .venv/installed-test setup-test
	$(BIN)/cmake -S . -B $(@D) -G Ninja -DCMAKE_MAKE_PROGRAM=$(CURDIR)/$(BIN)/ninja \
	  -DFRACGYRO_PYTHON=OFF -DFRACGYRO_TESTS=ON -DFRACGYRO_WARNINGS_AS_ERRORS=ON $(OPTIONS) >/dev/null
	$(BIN)/cmake --build $(@D) -- --quiet
	@touch $@
