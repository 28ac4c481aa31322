"""Manifests of a folder of finished recordings: each describes the Parquet files of one of them.

    DIR/manifests/<key>.json                    written last; replacing it is what makes a result count
    DIR/parts/<key>/<token>/<table>.parquet     the rows of one recording
    DIR/work/<key>/...                          windows of long recordings, until these are put together

A reader takes files that a manifest lists, so what a killed task left behind is never seen. The key is
the recording's id; of a file that is no recording, a hash of its path.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import uuid
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import pyarrow.parquet as pq

from pipeline.core.errors import StoreError, Where
from pipeline.mcap_file.bag import parts_of, size_of
from pipeline.store.schema import SCHEMA_VERSION

FORMAT = 1
_BLOCK = 1 << 20


@dataclass(frozen=True, slots=True)
class Source:
    """A recording's file by name, size and time: compared before its content is read (as rsync does)."""

    path: str
    size_bytes: int
    mtime_ns: int

    @classmethod
    def of(cls, path: Path) -> Source:
        """Return name, size and time of a file, or of a bag.

        Raises:
            OSError: there is no such file.
        """
        newest_ns = max(part.stat().st_mtime_ns for part in parts_of(path))
        return cls(str(path.absolute()), size_of(path), newest_ns)


@dataclass(frozen=True, slots=True)
class Part:
    """One file of rows; its path starts at the folder."""

    path: str
    rows: int
    size_bytes: int
    sha256: str


@dataclass(frozen=True, slots=True)
class Manifest:
    """One recording that is done, or that cannot be read."""

    key: str
    source: Source
    content_sha256: str | None
    configuration_sha256: str
    software_version: str
    run_id: str
    frame_count: int
    frames_lost: int
    damaged: bool
    failure: str | None
    parts: Mapping[str, Part]
    schema_version: int = SCHEMA_VERSION
    format: int = FORMAT

    def answers(self, source: Source, configuration_sha256: str, software_version: str) -> bool:
        """Return true if a run of that file with that configuration and version would make the same."""
        made_by = (self.source, self.configuration_sha256, self.software_version)
        return (
            self.failure is None
            and made_by == (source, configuration_sha256, software_version)
            and (self.schema_version, self.format) == (SCHEMA_VERSION, FORMAT)
        )


def key_of_failure(source: Source) -> str:
    """Return the key of a file that is no recording."""
    return "unread-" + hashlib.sha256(os.fsencode(source.path)).hexdigest()[:16]


def new_parts_folder(folder: Path, key: str) -> Path:
    """Make a folder for a recording's files; its name is new, so that nothing is overwritten."""
    made = folder / "parts" / key / uuid.uuid4().hex[:12]
    made.mkdir(parents=True)
    return made


def describe_part(folder: Path, path: Path) -> Part:
    """Return the description of a file, as a manifest has it."""
    rows = pq.read_metadata(path).num_rows
    return Part(str(path.relative_to(folder)), rows, path.stat().st_size, file_sha256(path))


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file."""
    digest = hashlib.sha256()
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Make a result count, in place of an older one of the same recording, whose files go."""
    target = folder / "manifests" / f"{manifest.key}.json"
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f".{target.name}.{uuid.uuid4().hex[:8]}")
    with part.open("w", encoding="utf-8") as stream:
        json.dump(asdict(manifest), stream, indent=1, sort_keys=True)
        stream.flush()
        os.fsync(stream.fileno())
    part.replace(target)
    kept = {Path(p.path).parent.name for p in manifest.parts.values()}
    for old in (folder / "parts" / manifest.key).iterdir():
        if old.name not in kept:
            shutil.rmtree(old, ignore_errors=True)


def forget_manifest(folder: Path, key: str) -> None:
    """Let a result count no longer, and take its files away."""
    (folder / "manifests" / f"{key}.json").unlink(missing_ok=True)
    shutil.rmtree(folder / "parts" / key, ignore_errors=True)


def read_manifest(path: Path) -> Manifest:
    """Read one manifest.

    Raises:
        StoreError: it is none, or of another format.
    """
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
        tree["source"] = Source(**tree["source"])
        tree["parts"] = {name: Part(**part) for name, part in tree["parts"].items()}
        manifest = Manifest(**tree)
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise StoreError(
            f"is no manifest of a recording: {error}",
            where=Where(path),
            remedy="Delete it, then run the same command again",
        ) from error
    if (manifest.format, manifest.schema_version) != (FORMAT, SCHEMA_VERSION):
        raise StoreError(
            f"has tables of version {manifest.schema_version}; this stadimeter has version "
            f"{SCHEMA_VERSION}",
            where=Where(path),
            remedy="Run the recordings again with this version, into another folder",
        )
    return manifest


def read_manifests(folder: Path) -> Iterator[Manifest]:
    """Yield the manifests of a folder, by key.

    Raises:
        StoreError: the folder holds none, or one that cannot be read.
    """
    paths = sorted((folder / "manifests").glob("*.json"))
    if not paths:
        raise StoreError(
            "no recording is finished here",
            where=Where(folder),
            remedy="`stadimeter run --parts DIR` fills such a folder",
        )
    yield from map(read_manifest, paths)
