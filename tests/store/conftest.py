"""A store that every test may fill; making its views takes longer than copying it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline.store.database import Store


@pytest.fixture(scope="session")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("template") / "empty.duckdb"
    Store.open(path).__exit__(None, None, None)
    return path


@pytest.fixture
def path(template: Path, tmp_path: Path) -> Path:
    """A database without rows."""
    copy = tmp_path / "a.duckdb"
    shutil.copyfile(template, copy)
    return copy


@pytest.fixture
def store(path: Path) -> Iterator[Store]:
    with Store.open(path) as opened:
        yield opened
