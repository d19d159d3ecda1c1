# make reproduce   the paper's study, into out/report.html
# make test        every check and every test
# make bench       the measurements that the README quotes
# Parts of them: check, test-core, test-python, setup-test; and clean. ARGS="..." goes to reproduce.

PYTHON ?= python3
BIN := .venv/bin
CPP := $(shell find core sim bindings faces tests benchmarks -name '*.[ch]pp' 2>/dev/null)
BUILT_FROM := pyproject.toml CMakeLists.txt $(filter core/% sim/% bindings/%,$(CPP)) $(shell find faces -type f)
SUDO = $(shell [ "$$(id -u)" = 0 ] || command -v sudo)

.PHONY: reproduce test check test-core test-python bench setup-test clean
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

bench: .venv/installed-bench
	$(BIN)/python benchmarks/operator_accuracy.py
	$(BIN)/python benchmarks/loop.py
	$(BIN)/python benchmarks/scaling.py
	$(BIN)/python benchmarks/reproduction.py

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
