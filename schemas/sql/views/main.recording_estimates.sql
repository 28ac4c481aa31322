-- How far away and how tall is every object in every frame of each recording, by its newest run?
CREATE OR REPLACE VIEW main.recording_estimates AS
SELECT
    estimates.recording_id, observations.camera, observations.frame_index,
    frames.capture_time_ns, observations.track_id, observations.class_name,
    estimates.* EXCLUDE (recording_id),
    greatest(depth_m - stats.normal_95() * depth_std_m, 0) AS depth_low_m,
    depth_m + stats.normal_95() * depth_std_m AS depth_high_m,
    greatest(height_m - stats.normal_95() * height_std_m, 0) AS height_low_m,
    height_m + stats.normal_95() * height_std_m AS height_high_m,
    make_timestamp_ns(frames.capture_time_ns) AS captured_at, recordings.file_name
FROM main.estimates
JOIN main.current_run USING (recording_id, run_id)
JOIN main.observations USING (recording_id, observation_index)
JOIN main.recordings USING (recording_id)
LEFT JOIN main.frames USING (recording_id, camera, frame_index);

COMMENT ON VIEW main.recording_estimates IS 'How far away and how tall is every object in every frame, by every method of the newest run of its recording? For questions on one recording: frames that several recordings hold are in each; current_estimates has them once.';
COMMENT ON COLUMN main.recording_estimates.height_low_m IS 'Lower end of the 95 % interval of the height in this frame.';
COMMENT ON COLUMN main.recording_estimates.height_high_m IS 'Upper end of the 95 % interval of the height in this frame.';
