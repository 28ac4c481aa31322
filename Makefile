# make demo    set everything up and run the main job on the recordings in recordings/
# make test    set everything up and run the tests
# make lint    the linters and the type checker
# make fuzz    hostile bytes into the readers, at least 100,000
# make bench   speed and accuracy, as ratios in one run
# make docs    the dictionary of tables, docs/tables.md, from the comments in schemas/sql
# make pictures   the pictures of the documentation, from what make demo left
# make lock    bring requirements*.lock up to date with pyproject.toml
# make proto   generate schemas/stadimeter_pb2.py from schemas/stadimeter.proto

.DELETE_ON_ERROR:
.PHONY: demo test lint format bench docs pictures fuzz lock proto clean

VENV := .venv
BIN := $(VENV)/bin
# The newest Python that is there and new enough; `make PYTHON=...` names another.
PYTHON ?= $(shell for p in python3.14 python3.13 python3.12 python3.11 python3 python; do \
	$$p -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' \
	>/dev/null 2>&1 && echo $$p && break; done)
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

demo: $(VENV)/.ready
	$(BIN)/stadimeter demo

test: $(VENV)/.ready-dev
	$(BIN)/python -m pytest --numprocesses auto --maxprocesses 8 --dist worksteal $(TESTS)

lint: $(VENV)/.ready-dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

format: $(VENV)/.ready-dev
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

bench: $(VENV)/.ready-dev
	$(BIN)/python -m bench

docs: $(VENV)/.ready
	$(BIN)/python -m dashboards.for_docs.tables docs/tables.md

pictures: $(VENV)/.ready
	$(BIN)/python -m dashboards.for_docs.pictures out/demo docs

# atheris has wheels for Linux; elsewhere, or for a Python without one, inputs are mutated only.
fuzz: $(VENV)/.ready-dev
	-$(PIP) install --require-hashes --only-binary :all: -r requirements-fuzz.lock
	$(BIN)/python -m fuzz $(FUZZ)

$(VENV)/.python:
	@test -n "$(PYTHON)" || { echo "stadimeter needs Python 3.11 or newer with venv and pip" \
		"(Debian: apt install python3-venv)." >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/.ready: $(VENV)/.python requirements.lock pyproject.toml
	$(PIP) install --require-hashes -r requirements.lock
	$(PIP) install --no-deps --no-build-isolation --editable .
	@touch $@

$(VENV)/.ready-dev: $(VENV)/.ready requirements-dev.lock
	$(PIP) install --require-hashes -r requirements-dev.lock
	@touch $@

# Needs `uv` on the PATH. One lock for every Python and platform; hashes, no index addresses.
LOCK := uv pip compile pyproject.toml requirements-build.in --extra report --universal \
	--python-version 3.11 --generate-hashes --no-header --no-annotate --no-emit-index-url --quiet
lock:
	$(LOCK) --output-file requirements.lock
	$(LOCK) --group dev --constraint requirements.lock --output-file requirements-dev.lock
	uv pip compile --group fuzz --universal --python-version 3.11 \
		--generate-hashes --no-header --no-annotate --no-emit-index-url --quiet \
		--output-file requirements-fuzz.lock

# Needs `grpcio-tools` in the Python that runs it.
proto:
	$(PYTHON) -m grpc_tools.protoc --proto_path=schemas --python_out=schemas --pyi_out=schemas \
		schemas/stadimeter.proto

clean:
	rm -rf $(VENV) out build *.egg-info
