-- Which run's estimates count for each recording?
CREATE OR REPLACE VIEW main.current_run AS
SELECT recording_id, run_id FROM main.recording_runs WHERE is_current;

COMMENT ON VIEW main.current_run IS 'Which run''s estimates count for each recording? The newest that has any.';
COMMENT ON COLUMN main.current_run.run_id IS 'The newest run that estimated the recording.';
