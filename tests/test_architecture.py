"""Architecture of the packages: imports run down only, folders stay small, docstrings state a thing.

The floors are those of ARCHITECTURE.md. Every import counts: at the top of a module, in a function,
under `TYPE_CHECKING` (a module that names another's types depends on them as well) and as a constant
string given to `import_module`.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# Rooms by floor. A room may import rooms of lower floors. Its sub-folders belong to it.
FLOORS: dict[int, tuple[str, ...]] = {
    11: ("bench", "fuzz"),
    10: ("recordings",),
    9: ("pipeline.cli",),
    8: ("stadimeter",),
    7: ("pipeline.cluster", "pipeline.statement"),
    6: ("pipeline.run",),
    5: ("pipeline.calibrate", "pipeline.export", "pipeline.importing", "dashboards"),
    4: ("pipeline.ingest", "pipeline.estimate", "pipeline.truth"),
    3: ("pipeline.messages", "pipeline.detect", "pipeline.measure"),
    2: (
        "pipeline.mcap_file",
        "pipeline.images",
        "pipeline.track",
        "pipeline.store",
        "pipeline.parallel",
    ),
    1: ("pipeline.core", "pipeline.optics", "schemas"),
    0: ("pipeline",),  # pipeline/__init__.py: the version, and nothing else
}
FLOOR = {room: floor for floor, rooms in FLOORS.items() for room in rooms}
PACKAGES = sorted({room.partition(".")[0] for room in FLOOR})
# Rooms that may import `dashboards`: pictures for people are made on request only.
SHOW_PICTURES = {"stadimeter", "bench"}
MOST_FILES = 20

QUESTION = re.compile(r"(Where|What|Which|Who|Whom|Whose|How|Whether|When|Why)\b")


def _room(module: str) -> str | None:
    """Innermost room that a module (or a name in one) belongs to; None outside the project."""
    while module:
        if module in FLOOR:
            return module
        module = module.rpartition(".")[0]
    return None


@cache
def _files(package: str) -> list[tuple[Path, ast.Module]]:
    paths = sorted((ROOT / package).rglob("*.py"))
    return [(path, ast.parse(path.read_text(encoding="utf-8"))) for path in paths]


def _own_name(path: Path) -> str:
    """Dotted name of a module by its path."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def _imported(path: Path, tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and dotted name of all that a module imports, wherever the import stands."""
    package = _own_name(path) if path.stem == "__init__" else _own_name(path).rpartition(".")[0]
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=names):
                yield from ((node.lineno, alias.name) for alias in names)
            case ast.ImportFrom(module=module, names=names, level=level):
                base = module or ""
                if level:
                    above = package.split(".")[: len(package.split(".")) - (level - 1)]
                    base = ".".join([*above, *([module] if module else [])])
                yield from ((node.lineno, f"{base}.{alias.name}") for alias in names)
            case ast.Call(func=func, args=[ast.Constant(value=str(name)), *_]):
                called = func.attr if isinstance(func, ast.Attribute) else getattr(func, "id", "")
                if called in ("import_module", "__import__"):
                    yield node.lineno, name


def _arrows(package: str) -> Iterator[tuple[str, str, str]]:
    """Importing room, imported room, and the place, of each import between two rooms."""
    for path, tree in _files(package):
        source = _room(_own_name(path))
        assert source is not None
        for line, name in _imported(path, tree):
            target = _room(name)
            if target is not None and target != source:
                yield source, target, f"{path.relative_to(ROOT)}:{line} imports {name}"


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_run_down(package):
    wrong = [place for source, target, place in _arrows(package) if FLOOR[target] >= FLOOR[source]]
    assert not wrong, "these run up, or sideways on one floor:\n" + "\n".join(wrong)


@pytest.mark.parametrize("package", PACKAGES)
def test_only_the_faces_import_dashboards(package):
    wrong = [
        place
        for source, target, place in _arrows(package)
        if target == "dashboards" and source not in SHOW_PICTURES
    ]
    assert not wrong, "\n".join(wrong)


def test_imports_of_every_form_are_seen():
    """Oracle of the reader above: a module with each form of import, read as the project's are."""
    text = """
from typing import TYPE_CHECKING
import pipeline.run.workers
from . import store
from ..cluster.manifest import Part
if TYPE_CHECKING:
    from dashboards.report import writer
def later():
    import importlib
    from pipeline.cli import main
    importlib.import_module("bench.paper")
"""
    seen = [name for _, name in _imported(ROOT / "pipeline/run/example.py", ast.parse(text))]
    assert [_room(name) for name in seen] == [
        None,
        "pipeline.run",
        "pipeline.run",
        "pipeline.cluster",
        "dashboards",
        None,
        "pipeline.cli",
        "bench",
    ]


def test_the_page_on_the_architecture_has_the_same_floors():
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| +(\d+) \| ([^|]+) \|", text, re.MULTILINE)
    told = {int(floor): set(rooms.split(", ")) for floor, rooms in rows}
    assert told == {floor: set(rooms) for floor, rooms in FLOORS.items() if floor}


def test_every_folder_of_the_pipeline_has_a_floor():
    folders = {path.parent.name for path in (ROOT / "pipeline").glob("*/*.py")}
    without = sorted(name for name in folders if f"pipeline.{name}" not in FLOOR)
    assert not without, f"put these on a floor, here and in ARCHITECTURE.md: {without}"


@pytest.mark.parametrize("package", [*PACKAGES, "tests"])
def test_folders_are_small(package):
    counts: dict[Path, int] = {}
    for path, _ in _files(package):
        counts[path.parent] = counts.get(path.parent, 0) + 1
    crowded = {str(p.relative_to(ROOT)): n for p, n in counts.items() if n > MOST_FILES}
    assert not crowded, f"more than {MOST_FILES} modules in one folder: {crowded}"


def test_no_module_lies_loose_in_the_pipeline():
    loose = {path.name for path in (ROOT / "pipeline").glob("*.py")} - {"__init__.py"}
    assert not loose, "a module belongs in the folder of its stage"


@pytest.mark.parametrize("package", [*PACKAGES, "tests"])
def test_docstrings_begin_with_a_noun_or_a_verb(package):
    wrong = []
    for path, tree in _files(package):
        name = str(path.relative_to(ROOT))
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                text = ast.get_docstring(node) or ""
                if QUESTION.match(text):
                    line = getattr(node, "lineno", 1)
                    wrong.append(f"{name}:{line}: {text.partition(chr(10))[0]}")
    assert not wrong, "begin with a noun or a verb:\n" + "\n".join(wrong)
