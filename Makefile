# Sets itself up in .venv on first use; nothing is done twice.
#   make demo    water poured on a cotton cloth, as a film and a ledger, in outputs/seep/
#   make test    what must hold
#   make bench   seconds by stage, side by side with pySPlisHSPlasH (20 minutes of an idle machine)
#   make lint    style
#   make lock    requirements.lock anew, from pyproject.toml (needs uv)

PYTHON ?=
RUN := .venv/bin/python
FITS := import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))

# Sets $$pip to what installs into the Python $(1): its own pip, or another's.
define find_pip
if $(1) -m pip --version >/dev/null 2>&1; then pip="$(1) -m pip"; \
	else \
	    pip=; \
	    for candidate in $(PYTHON) python3 python3.13 python3.12 python3.11; do \
	        if $$candidate -m pip --python $(1) --version >/dev/null 2>&1; then \
	            pip="$$candidate -m pip --python $(1)"; break; \
	        fi; \
	    done; \
	    if [ -z "$$pip" ]; then echo "make: needs pip; install it (Debian: apt install python3-venv)" >&2; exit 1; fi; \
	fi
endef

.PHONY: demo test bench lint lock
.DELETE_ON_ERROR:

demo: .venv/.ready
	@$(RUN) main.py run seep

test: .venv/.ready
# Two files at a time, a thread each: nearly all tests run on one. More side by side would want memory.
	@$(RUN) -m pytest -q -n 2 --dist loadfile --no-loadscope-reorder tests

# The rivals have a Python of their own: SEEP_PEERS names one that has them, else .venv-peers is made. Without them the
# bench still times this program.
bench: .venv/.ready
	@test -n "$$SEEP_PEERS" || $(MAKE) --no-print-directory .venv-peers/.ready || \
	    echo "make: the rivals are not there; SEEP_PEERS may name a Python that has them" >&2
	@$(RUN) main.py bench

.venv-peers/.ready: sim/studies/peers/requirements.txt
	@set -e; \
	rm -rf .venv-peers; \
	if $(RUN) -c 'import ensurepip' 2>/dev/null; then $(RUN) -m venv .venv-peers; \
	else $(RUN) -m venv --without-pip .venv-peers; fi; \
	$(call find_pip,.venv-peers/bin/python); \
	$$pip install --quiet --quiet --disable-pip-version-check --only-binary :all: -r $<; \
	touch $@

lint: .venv/.ready
	@$(RUN) -m ruff check .
	@$(RUN) -m ruff format --check .

lock:
	@command -v uv >/dev/null || { echo "make lock: install uv first" >&2; exit 1; }
	@uv pip compile --quiet --universal --generate-hashes --python-version 3.11 --no-header --no-annotate \
	    --extra test --output-file requirements.lock pyproject.toml

# A pyenv shim may exist and not run, so each candidate is tried. Where venv lacks ensurepip (Debian without
# python3-venv), the environment is made without pip and filled by the system's pip.
.venv/.ready: requirements.lock
	@set -e; \
	if ! .venv/bin/python -c '$(FITS)' 2>/dev/null; then \
	    found=; \
	    for candidate in $(PYTHON) python3 python3.13 python3.12 python3.11; do \
	        if $$candidate -c '$(FITS)' 2>/dev/null; then found=$$candidate; break; fi; \
	    done; \
	    if [ -z "$$found" ]; then \
	        echo "make: needs Python 3.11, 3.12 or 3.13; install one (Debian: apt install python3 python3-venv)" >&2; \
	        exit 1; \
	    fi; \
	    echo "setting up .venv with $$($$found --version)"; \
	    rm -rf .venv; \
	    if $$found -c 'import ensurepip' 2>/dev/null; then $$found -m venv .venv; \
	    else $$found -m venv --without-pip .venv; fi; \
	fi; \
	$(call find_pip,$(RUN)); \
	$$pip install --quiet --quiet --disable-pip-version-check --require-hashes --only-binary :all: -r requirements.lock || { \
	    echo "make: packages not installed; there are wheels for x86_64 Linux, macOS and Windows only" >&2; exit 1; }; \
	$(RUN) -c 'import taichi' >/dev/null 2>&1 || { \
	    echo "make: Taichi does not load; install libX11 (Debian: apt install libx11-6)" >&2; exit 1; }; \
	touch .venv/.ready
