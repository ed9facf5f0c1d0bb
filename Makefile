# Every target sets up what is missing: a virtual environment from the lock file, the messages, the compiled kernel.
# The files in $(DONE) remember what is done; the kernel is built for every level of this machine's kind of CPU.

VENV := .venv
PYTHON := $(VENV)/bin/python
DONE := $(VENV)/done
CHECKED := contact_curation test benchmarks bags conformance examples msg_defs setup.py .ci/lock .ci/sbom
TYPED := contact_curation test benchmarks bags conformance examples

MESSAGE_SOURCES := $(shell find msg_defs -name build -prune -o -name '*.egg-info' -prune -o -name __pycache__ -prune -o -type f -print)
KERNEL_SOURCES := $(wildcard contact_curation/*/kernel/*)
FORMATTED := $(KERNEL_SOURCES) $(wildcard test/kernel/*.cpp test/fuzz/*.cpp)

# A sourced ROS would put its own packages before those of the virtual environment.
unexport PYTHONPATH PYTHONHOME AMENT_PREFIX_PATH COLCON_PREFIX_PATH CMAKE_PREFIX_PATH LD_LIBRARY_PATH
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
# Without bytecode every process of the demo and the tests, and there are hundreds, compiles its modules anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test test-slow fuzz mutants check format site wheel bench figures setup lock clean distclean sbom
.DELETE_ON_ERROR:

demo: setup
	$(PYTHON) -m contact_curation.cli.demo $(if $(DATA),--data $(DATA)) $(if $(DASHBOARD),--dashboard)

# Each file on one of three processes, on two cores: the tests of live graphs wait more than they work.
test: setup
	$(PYTHON) -m pytest -n 3 --dist loadfile --no-loadscope-reorder

test-slow: setup
	$(PYTHON) -m pytest -m slow

# Every reader for so many seconds: make fuzz SECONDS=60 [TARGETS="mcap theta"]. What is found goes into test/fuzz/found.
fuzz: setup build/fuzz/site
	PYTHONPATH=build/fuzz/site nice -n 19 $(PYTHON) -m test.fuzz.run --seconds $(or $(SECONDS),60) $(TARGETS)

build/fuzz/site:
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --target $@ atheris==3.1.0

# Do the tests notice what is changed? Takes hours; the library's half needs mutmut in the environment.
mutants: setup
	$(PYTHON) -m test.mutation.kernel --count 100
	$(PYTHON) -m test.mutation.library --count 300

check: setup
	$(PYTHON) -m ruff check $(CHECKED)
	$(PYTHON) -m ruff format --check $(CHECKED)
	$(VENV)/bin/clang-format --dry-run --Werror $(FORMATTED)
	$(PYTHON) -m mypy $(TYPED)
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict --quiet --site-dir build/site

format: setup
	$(PYTHON) -m ruff check --fix $(CHECKED)
	$(PYTHON) -m ruff format $(CHECKED)
	$(VENV)/bin/clang-format -i $(FORMATTED)

site: setup
	NO_MKDOCS_2_WARNING=1 $(PYTHON) -m mkdocs build --strict --quiet --site-dir build/site

# The package for any Python from 3.12 on, and the messages for this one: pip install --find-links dist 'contact-curation[ros]'
wheel: setup
	rm -rf build/lib* build/bdist* build/wheel dist
	PYTHONWARNINGS=ignore $(PYTHON) -m pip wheel --quiet --disable-pip-version-check --no-build-isolation --no-deps --wheel-dir build/wheel .
	PATH="$(VENV)/bin:$$PATH" $(PYTHON) -m auditwheel repair --wheel-dir dist build/wheel/*.whl
	PYTHONWARNINGS=ignore $(PYTHON) msg_defs/install.py --wheels dist
	@ls dist

bench: setup
	@set -e; for script in $$(find benchmarks -name '[!_]*.py' | sort); do \
		module=$$(echo $${script%.py} | tr / .); echo "== $$module"; $(PYTHON) -m $$module; \
	done

# The pictures in docs/images; the dashboard's, too, with DASHBOARD=1.
figures: setup
	$(PYTHON) -m test.docs.pictures $(if $(DASHBOARD),--dashboard)
	$(PYTHON) -m test.docs.moving_picture

setup: $(DONE)/package

$(DONE)/environment: requirements.lock
	@python=$$(.ci/find-python) && \
	if [ -e $(VENV) ] && ! $(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 12))' 2>/dev/null; then \
		rm -rf $(VENV); \
	fi && \
	if [ ! -e $(PYTHON) ]; then "$$python" -m venv $(VENV); fi
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	@mkdir -p $(DONE) && touch $@

$(DONE)/messages: $(DONE)/environment $(MESSAGE_SOURCES)
	$(PYTHON) msg_defs/install.py
	@touch $@

$(DONE)/package: $(DONE)/messages setup.py setup.cfg package.xml $(KERNEL_SOURCES)
	PYTHONWARNINGS=ignore $(PYTHON) -m pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps --editable .
	@touch $@

lock:
	.ci/find-python >/dev/null && $$(.ci/find-python) .ci/lock

# What is installed, as CycloneDX; no more than the lock file says.
sbom:
	@mkdir -p build
	$$(.ci/find-python) .ci/sbom build/sbom.json
	@echo build/sbom.json

clean:
	rm -rf build dist install log *.egg-info msg_defs/build msg_defs/*.egg-info msg_defs/vendored/*/build msg_defs/vendored/*/*.egg-info
	rm -rf .mypy_cache .ruff_cache .pytest_cache .hypothesis $(DONE)
	rm -f contact_curation/solver/_kernel_*
	find contact_curation test benchmarks msg_defs -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean
	rm -rf $(VENV)
