-- How far away and how tall is every object in every frame, by the newest run?
CREATE OR REPLACE VIEW main.current_estimates AS
SELECT
    estimates.recording_id, observations.camera, observations.frame_index,
    frames.capture_time_ns, observations.track_id, observations.class_name,
    estimates.* EXCLUDE (recording_id)
FROM main.estimates
JOIN main.current_run USING (recording_id, run_id)
JOIN main.observations USING (recording_id, observation_index)
LEFT JOIN main.frames USING (recording_id, camera, frame_index);

COMMENT ON VIEW main.current_estimates IS 'How far away and how tall is every object in every frame, by every method of the newest run of its recording?';
