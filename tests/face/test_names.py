"""Names that the package promises, and the cost of importing it."""

from __future__ import annotations

import ast
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import stadimeter

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ast.parse((ROOT / "stadimeter" / "__init__.py").read_text())
# Commands ask the face; what else they import is for parsing, errors and printing.
CLI_MAY_IMPORT = ("stadimeter", "pipeline.cli", "pipeline.core")
CLI_MAY_ALSO = {
    "main.py": {"pipeline"},  # the version
    "run.py": {"pipeline.detect"},  # the names of the detectors
    "import_.py": {"pipeline.importing.photos"},  # photos or a video
}


def test_each_promised_name_is_there_and_no_other() -> None:
    for name in stadimeter.__all__:
        assert getattr(stadimeter, name) is not None
    assert dir(stadimeter) == sorted(stadimeter.__all__)
    assert len(set(stadimeter.__all__)) == len(stadimeter.__all__)
    assert not [n for n in stadimeter.__all__ if n.startswith("_") and n != "__version__"]
    with pytest.raises(AttributeError, match="no attribute 'Store'"):
        stadimeter.Store  # noqa: B018


def test_type_checkers_see_the_names_that_are_loaded() -> None:
    typed: dict[str, str] = {}
    for node in ast.walk(SOURCE):
        if isinstance(node, ast.ImportFrom) and node.module and node.module != "__future__":
            typed |= {alias.name: node.module for alias in node.names}
    del typed["TYPE_CHECKING"], typed["Any"], typed["import_module"]
    assert typed == stadimeter._MODULE_OF
    assert set(typed) == set(stadimeter.__all__)
    assert (ROOT / "stadimeter" / "py.typed").is_file()


def test_functions_have_types_and_say_what_they_raise() -> None:
    functions = [
        f for f in (getattr(stadimeter, n) for n in stadimeter.__all__) if inspect.isfunction(f)
    ]
    assert len(functions) >= 13
    for function in functions:
        signature = inspect.signature(function)
        assert signature.return_annotation is not inspect.Signature.empty, function
        for parameter in signature.parameters.values():
            assert parameter.annotation is not inspect.Parameter.empty, (function, parameter)
        assert "Raises:" in (function.__doc__ or ""), function


def test_importing_it_costs_little_and_loads_no_library() -> None:
    code = (
        "import sys, time; start = time.process_time(); import stadimeter; "
        "spent = time.process_time() - start; "
        "heavy = {'numpy', 'pyarrow', 'duckdb', 'cv2', 'pandas', 'rerun', 'scipy', 'rich'}; "
        "print(spent, sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    spent_s, loaded = done.stdout.split(maxsplit=1)
    assert float(spent_s) < 0.2
    assert loaded.strip() == "[]"


@pytest.mark.parametrize("path", sorted((ROOT / "pipeline" / "cli").glob("*.py")), ids=str)
def test_commands_call_the_face_and_nothing_below_it(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        for name in names:
            if name.partition(".")[0] in ("pipeline", "dashboards", "schemas"):
                allowed = name.startswith(CLI_MAY_IMPORT)
                assert allowed or name in CLI_MAY_ALSO.get(path.name, ()), (path.name, name)
