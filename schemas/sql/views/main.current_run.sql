-- Which run's estimates count for each recording?
CREATE OR REPLACE VIEW main.current_run AS
WITH estimated AS (
    SELECT DISTINCT recording_id, run_id FROM main.estimates
)
SELECT estimated.recording_id, arg_max(runs.run_id, (runs.started_at, runs.run_id)) AS run_id
FROM estimated JOIN main.runs USING (run_id)
GROUP BY estimated.recording_id;

COMMENT ON VIEW main.current_run IS 'Which run''s estimates count for each recording? The newest that has any.';
COMMENT ON COLUMN main.current_run.run_id IS 'The newest run that estimated the recording.';
