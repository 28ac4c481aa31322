-- Which runs are there of each recording, also those that are kept beside the current measurement?
CREATE OR REPLACE VIEW main.all_runs AS
WITH found AS (
    SELECT
        runs.recording_id, runs.file_name, recordings.run_id AS measured_by, runs.run_id,
        runs.is_current, FALSE AS is_kept_aside
    FROM main.recording_runs AS runs JOIN main.recordings USING (recording_id)
    UNION ALL
    SELECT recording_id, file_name, run_id, run_id, TRUE, FALSE
    FROM main.recordings
    ANTI JOIN main.recording_runs USING (recording_id)
    UNION ALL
    SELECT recording_id, file_name, measured_by, run_id, FALSE, TRUE FROM main.kept_runs
)
SELECT
    found.* EXCLUDE (is_current, is_kept_aside), runs.label AS run_label, runs.command,
    runs.started_at, runs.software_version, is_current, is_kept_aside,
    coalesce(runs.keep, FALSE) AS keep
FROM found LEFT JOIN main.runs USING (run_id)
ORDER BY runs.started_at, found.run_id, found.file_name, found.recording_id;

COMMENT ON VIEW main.all_runs IS 'Which runs are there of each recording, also those that are kept beside the current measurement? `stadimeter runs` shows it.';
COMMENT ON COLUMN main.all_runs.is_kept_aside IS 'TRUE if the rows are kept beside the current measurement, in the schema `kept`; `stadimeter runs current` brings them back.';
