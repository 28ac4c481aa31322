"""Finished recordings of a folder that hold the same evidence: it counts once, and is told.

A recording that was read while it grew is replaced by the whole one, as in a database. Frames that two
recordings hold stay in both, and the view `repeated_frames` tells which do not count.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.cluster.manifest import Manifest, forget_manifest, read_manifests
from pipeline.cluster.results_folder import open_shared, row_of
from pipeline.core.records import Diagnostic, Severity
from pipeline.run.same_evidence import repeated_frames, same_as_stored


@dataclass(slots=True)
class Settled:
    """Results that do not count, and what is to be told, by file name."""

    beginnings: dict[str, str] = field(default_factory=dict)  # key -> path of the whole recording
    notes: list[tuple[str, Diagnostic]] = field(default_factory=list)


def settle(folder: Path, made: Sequence[Manifest], paths_before: Mapping[str, str]) -> Settled:
    """Take away results that are only the beginning of another, and find what else is there twice.

    Args:
        folder: the folder of finished recordings.
        made: results that are new in it.
        paths_before: files of the results that it had before, by key.
    """
    found = Settled()
    if not made:
        return found
    keys = {manifest.key for manifest in read_manifests(folder)}
    with open_shared(folder) as store:
        for manifest in made:
            name = Path(manifest.source.path).name
            before = paths_before.get(manifest.key, manifest.source.path)
            if before != manifest.source.path:
                text = f"the same bytes were stored before, from {before}; they count once"
                found.notes.append((name, Diagnostic(Severity.WARNING, "same_content", text)))
            same = same_as_stored(store, row_of(folder, manifest))
            if same.whole:
                found.beginnings[manifest.key] = same.whole
                forget_manifest(folder, manifest.key)
            for key in same.replaced:
                forget_manifest(folder, key)
            found.notes += [(name, note) for note in same.notes if note.code != "same_content"]
            keys -= {*same.replaced, *([manifest.key] if same.whole else [])}
    if keys:
        with open_shared(folder) as store:
            said = repeated_frames(store, [m.key for m in made if m.key in keys])
        found.notes += [(one.file_name, one.note) for one in said]
    return found
