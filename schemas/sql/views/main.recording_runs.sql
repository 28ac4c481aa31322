-- Which runs estimated which recordings, and which of them counts?
CREATE OR REPLACE VIEW main.recording_runs AS
WITH estimated AS (
    SELECT DISTINCT recording_id, run_id FROM main.estimates
)
SELECT
    estimated.recording_id, recordings.file_name, estimated.run_id, runs.label AS run_label,
    runs.started_at,
    row_number() OVER (
        PARTITION BY estimated.recording_id ORDER BY runs.started_at DESC, estimated.run_id
    ) = 1 AS is_current
FROM estimated
JOIN main.runs USING (run_id)
LEFT JOIN main.recordings USING (recording_id);

COMMENT ON VIEW main.recording_runs IS 'Which runs estimated which recordings, and which of them counts? The newest that has any estimates is the current one, whether it ended or not.';
