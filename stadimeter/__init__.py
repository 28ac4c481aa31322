"""Distances and heights, with intervals, of the people and things in recorded camera footage.

    import stadimeter

    stadimeter.measure("street.mcap", "street.duckdb")
    with stadimeter.open("street.duckdb") as results:
        heights = results.view("track_heights").pandas()

`__all__` is what is promised to stay; the modules below this package are not. Each name is loaded at
its first use, so that importing the package costs next to nothing. `docs/python.md` shows all of it.

Units are in the names: `_m` metres, `_px` pixels of the stored picture, `_rad` and `_deg` angles, `_ns`
and `_s` times. Unknown is NULL in a table and NaN in a configuration, never zero. Every error is a
`StadimeterError` with `problem`, `where` and `remedy`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pipeline import __version__
    from pipeline.calibrate.blur_floor import BlurFloor
    from pipeline.cluster.shared_run import SharedResult
    from pipeline.core.calibration import CalibratedMethod, Calibration, Dimension
    from pipeline.core.config import (
        CameraConfig,
        Config,
        DetectConfig,
        EstimateConfig,
        ExposureFields,
        IngestConfig,
        Limits,
        SizePrior,
        TimelineConfig,
        TrackConfig,
    )
    from pipeline.core.errors import (
        CalibrationUndetermined,
        DamagedRecording,
        MissingLibrary,
        NotARecording,
        StadimeterError,
        StoreError,
        UndecodableImage,
        UnsupportedChannel,
        UnusableModel,
        UsageError,
        Where,
    )
    from pipeline.core.progress import Progress
    from pipeline.export.recording import Exported
    from pipeline.importing.photos import Imported
    from pipeline.ingest.survey import CameraSurvey, ChannelSurvey, Survey
    from pipeline.run.calibration import FittedToTruth, Found
    from pipeline.run.recording import Outcome
    from pipeline.run.recordings import RunResult
    from pipeline.run.verify import Verified
    from pipeline.truth.stored import AddedTruth
    from stadimeter.arguments import load_config
    from stadimeter.calibration import calibrate
    from stadimeter.importing import ImportedVideo, import_photos, import_video
    from stadimeter.kept import keep_run, make_current, remove_run, runs
    from stadimeter.measurement import DamageWarning, Estimated, estimate, measure, measure_parts
    from stadimeter.outputs import Reviewed, export, report, review
    from stadimeter.recordings import inspect
    from stadimeter.results import Relation, Results, merge, open
    from stadimeter.statements import marks_page, statement
    from stadimeter.summary import (
        CameraSummary,
        Finding,
        RecordingSummary,
        RunSummary,
        TrackSummary,
        Unmeasured,
        summarize,
    )
    from stadimeter.true_values import truth
    from stadimeter.verification import verify

_MODULES = {
    "pipeline": ("__version__",),
    "pipeline.calibrate.blur_floor": ("BlurFloor",),
    "pipeline.cluster.shared_run": ("SharedResult",),
    "pipeline.core.calibration": ("CalibratedMethod", "Calibration", "Dimension"),
    "pipeline.core.config": (
        "CameraConfig",
        "Config",
        "DetectConfig",
        "EstimateConfig",
        "ExposureFields",
        "IngestConfig",
        "Limits",
        "SizePrior",
        "TimelineConfig",
        "TrackConfig",
    ),
    "pipeline.core.errors": (
        "CalibrationUndetermined",
        "DamagedRecording",
        "MissingLibrary",
        "NotARecording",
        "StadimeterError",
        "StoreError",
        "UndecodableImage",
        "UnsupportedChannel",
        "UnusableModel",
        "UsageError",
        "Where",
    ),
    "pipeline.core.progress": ("Progress",),
    "pipeline.export.recording": ("Exported",),
    "pipeline.importing.photos": ("Imported",),
    "pipeline.ingest.survey": ("CameraSurvey", "ChannelSurvey", "Survey"),
    "pipeline.run.calibration": ("FittedToTruth", "Found"),
    "pipeline.run.recording": ("Outcome",),
    "pipeline.run.recordings": ("RunResult",),
    "pipeline.truth.stored": ("AddedTruth",),
    "pipeline.run.verify": ("Verified",),
    "stadimeter.arguments": ("load_config",),
    "stadimeter.calibration": ("calibrate",),
    "stadimeter.importing": ("ImportedVideo", "import_photos", "import_video"),
    "stadimeter.measurement": (
        "DamageWarning",
        "Estimated",
        "estimate",
        "measure",
        "measure_parts",
    ),
    "stadimeter.outputs": ("Reviewed", "export", "report", "review"),
    "stadimeter.statements": ("marks_page", "statement"),
    "stadimeter.verification": ("verify",),
    "stadimeter.kept": ("keep_run", "make_current", "remove_run", "runs"),
    "stadimeter.recordings": ("inspect",),
    "stadimeter.results": ("Relation", "Results", "merge", "open"),
    "stadimeter.true_values": ("truth",),
    "stadimeter.summary": (
        "CameraSummary",
        "Finding",
        "RecordingSummary",
        "RunSummary",
        "TrackSummary",
        "Unmeasured",
        "summarize",
    ),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "AddedTruth",
    "BlurFloor",
    "CalibratedMethod",
    "Calibration",
    "CalibrationUndetermined",
    "CameraConfig",
    "CameraSummary",
    "CameraSurvey",
    "ChannelSurvey",
    "Config",
    "DamageWarning",
    "DamagedRecording",
    "DetectConfig",
    "Dimension",
    "EstimateConfig",
    "Estimated",
    "Exported",
    "ExposureFields",
    "Finding",
    "FittedToTruth",
    "Found",
    "Imported",
    "ImportedVideo",
    "IngestConfig",
    "Limits",
    "MissingLibrary",
    "NotARecording",
    "Outcome",
    "Progress",
    "RecordingSummary",
    "Relation",
    "Results",
    "Reviewed",
    "RunResult",
    "RunSummary",
    "SharedResult",
    "SizePrior",
    "StadimeterError",
    "StoreError",
    "Survey",
    "TimelineConfig",
    "TrackConfig",
    "TrackSummary",
    "UndecodableImage",
    "Unmeasured",
    "UnsupportedChannel",
    "UnusableModel",
    "UsageError",
    "Verified",
    "Where",
    "__version__",
    "calibrate",
    "estimate",
    "export",
    "import_photos",
    "import_video",
    "inspect",
    "keep_run",
    "load_config",
    "make_current",
    "marks_page",
    "measure",
    "measure_parts",
    "merge",
    "open",
    "remove_run",
    "report",
    "review",
    "runs",
    "statement",
    "summarize",
    "truth",
    "verify",
]

if not TYPE_CHECKING:  # a type checker reads the imports above, and so knows what is not there

    def __getattr__(name: str) -> Any:
        """Load a name at its first use."""
        if name not in _MODULE_OF:
            raise AttributeError(f"module 'stadimeter' has no attribute {name!r}")
        value = getattr(import_module(_MODULE_OF[name]), name)
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        """Return what is promised."""
        return list(__all__)
