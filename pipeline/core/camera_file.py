"""The camera file: what was calibrated, in the TOML that `pipeline.core.config.load_config` reads."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from pipeline.core.calibration import Calibration
from pipeline.core.config import CameraConfig, Config, read_config
from pipeline.core.errors import UsageError, Where
from pipeline.core.files import refuse_special

# What tells one entry of an array of tables from another: a new one replaces the old one.
_KEYS: Mapping[str, tuple[str, ...]] = {
    "camera": ("name",),
    "size_prior": ("object_class", "dimension"),
    "calibration": ("method", "camera", "object_class", "dimension"),
}
_HEADER = re.compile(r"^\s*\[\[?\s*([A-Za-z0-9_-]+)", re.MULTILINE)


def write_camera_file(path: Path, config: Config) -> None:
    """Write a configuration so that `read_config` reads it back, keeping what the file had.

    What `config` leaves at its default stays as it is in an existing file; of cameras, priors and
    calibrations, those of the same name, class, dimension or method are replaced and the others
    kept, and so are the comments outside the tables that change. The file is replaced in one step.

    Raises:
        UsageError: the existing file is not a camera file, or cannot be replaced; or a number that
            must be known is NaN.
    """
    refuse_special(path, "the camera file")
    exists = path.exists()
    old = read_config(path) if exists else Config()
    merged = merge(old, config) if exists else config
    texts = [to_toml(merged)]
    if exists:
        texts.insert(0, _edited(path.read_text(encoding="utf-8"), old, merged))
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        for text in texts:
            temporary.write_text(text, encoding="utf-8", newline="\n")
            if _reads_as(temporary, merged):
                break
        temporary.replace(path)
    except OSError as error:
        raise UsageError(
            f"cannot write the camera file: {error.strerror}", where=Where(path)
        ) from error
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)


def _reads_as(path: Path, config: Config) -> bool:
    """Return whether a file says what it should: unusual text may not be cut at its headers."""
    try:
        return repr(read_config(path)) == repr(config)
    except UsageError:
        return False


def merge(old: Config, new: Config) -> Config:
    """Return the old configuration with what the new one states."""
    changes: dict[str, Any] = {}
    for f in fields(Config):
        ours, theirs = getattr(old, f.name), getattr(new, f.name)
        if repr(theirs) in (repr(f.default), repr(ours)):
            continue
        changes[f.name] = _merge_entries(f.name, ours, theirs) if f.name in _KEYS else theirs
    return replace(old, **changes)


def to_toml(config: Config) -> str:
    """Return a configuration as TOML: what differs from the defaults."""
    blocks = [_block(name, config) for name in _section_names()]
    return "\n".join(block for block in sorted(blocks, key=_is_table) if block)


def _section_names() -> list[str]:
    return [f.name for f in fields(Config)]


def _is_table(block: str) -> bool:
    """Return whether a block opens a table: keys of the file itself must stand before all tables."""
    return block.startswith("[")


def _merge_entries(name: str, old: Sequence[Any], new: Sequence[Any]) -> tuple[Any, ...]:
    def key(entry: Any) -> tuple[str, ...]:
        return tuple(str(getattr(entry, k)) for k in _KEYS[name])

    entries = {key(e): e for e in old}
    for entry in new:
        known = entries.get(key(entry))
        if isinstance(entry, CameraConfig) and isinstance(known, CameraConfig):
            entries[key(entry)] = _merge_camera(known, entry)
        else:
            entries[key(entry)] = entry
    return tuple(entries.values())


def _merge_camera(old: CameraConfig, new: CameraConfig) -> CameraConfig:
    stated = {
        f.name: getattr(new, f.name)
        for f in fields(CameraConfig)
        if repr(getattr(new, f.name)) != repr(f.default)
    }
    return replace(old, **stated)


def _edited(text: str, old: Config, new: Config) -> str:
    """Return the old text with only the changed tables written anew, cut at the headers."""
    changed = [n for n in _section_names() if repr(getattr(old, n)) != repr(getattr(new, n))]
    headers = list(_HEADER.finditer(text))
    starts = [*(h.start() for h in headers), len(text)]
    kept = text[: starts[0]]
    for header, end in zip(headers, starts[1:], strict=True):
        if header.group(1) not in changed:
            kept += text[header.start() : end]
    blocks = [kept.rstrip("\n") + "\n" if kept.strip() else "", *(_block(n, new) for n in changed)]
    return "\n".join(block for block in blocks if block)


def _block(name: str, config: Config) -> str:
    """Return one section of the file as TOML; empty where it is the default."""
    value = getattr(config, name)
    default = next(f.default for f in fields(Config) if f.name == name)
    if repr(value) == repr(default):
        return ""
    if isinstance(value, str):
        return f"{name} = {_scalar(value, name)}\n"
    if is_dataclass(value):
        lines = _lines(value, name)
        return "\n".join([f"[{name}]", *lines, ""]) if lines else ""
    if not value:
        return f"{name} = []\n"
    return "\n".join("\n".join([f"[[{name}]]", *_lines(e, name), ""]) for e in value)


def _lines(value: Any, place: str) -> list[str]:
    """Return the fields of a record that differ from their defaults, as `key = value`."""
    lines = []
    for f in fields(value):
        item = getattr(value, f.name)
        if isinstance(value, Calibration) and f.name == "parameters":
            rows = [f"    {_inline(p, f'{place}.{f.name}')}," for p in item]
            lines.append("\n".join(["parameters = [", *rows, "]"]))
        elif repr(item) != repr(_default(f)):
            lines.append(f"{f.name} = {_scalar(item, f'{place}.{f.name}')}")
    return lines


def _inline(value: Any, place: str) -> str:
    stated = [
        f"{f.name} = {_scalar(getattr(value, f.name), f'{place}.{f.name}')}"
        for f in fields(value)
        if repr(getattr(value, f.name)) != repr(_default(f))
    ]
    return "{ " + ", ".join(stated) + " }"


def _default(f: Field[Any]) -> Any:
    return f.default if f.default is not MISSING else MISSING


def _scalar(value: Any, place: str) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        # JSON's escapes are TOML's, except that TOML also wants DEL escaped.
        return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")
    if is_dataclass(value):
        return _inline(value, place)
    if isinstance(value, tuple):
        return "[" + ", ".join(_scalar(v, place) for v in value) + "]"
    if isinstance(value, int):
        return str(value)
    if math.isnan(value):
        raise UsageError(f"{place} is not known; a camera file cannot say so")
    return repr(float(value))
