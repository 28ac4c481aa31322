-- Which runs estimated which recordings, and which of them counts?
CREATE OR REPLACE VIEW main.recording_runs AS
WITH estimated AS (
    SELECT DISTINCT recording_id, run_id FROM main.estimates
)
SELECT
    estimated.recording_id, recordings.file_name, estimated.run_id, runs.label AS run_label,
    runs.started_at,
    row_number() OVER (
        PARTITION BY estimated.recording_id
        ORDER BY chosen.run_id IS NULL, runs.started_at DESC, estimated.run_id
    ) = 1 AS is_current
FROM estimated
JOIN main.runs USING (run_id)
LEFT JOIN main.recordings USING (recording_id)
LEFT JOIN main.chosen_runs AS chosen
    ON chosen.recording_id = estimated.recording_id AND chosen.run_id = estimated.run_id;

COMMENT ON VIEW main.recording_runs IS 'Which runs estimated which recordings, and which of them counts? The one that `stadimeter runs current` chose, else the newest that has any estimates, whether it ended or not. Runs of kept measurements are in main.all_runs.';
