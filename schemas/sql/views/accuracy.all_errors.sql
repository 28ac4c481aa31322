-- How far is every estimate of every run from the truth?
CREATE OR REPLACE VIEW accuracy.all_errors AS
SELECT
    recording_id, recording_runs.file_name, run_id, recording_runs.run_label,
    recording_runs.is_current,
    matches.camera, matches.frame_index, matches.capture_time_ns, observation_index,
    matches.track_id, matches.object_id, matches.class_name, matches.rule AS match_rule,
    estimates.method, matches.f_number, estimates.calibration_id, estimates.in_calibrated_range,
    matches.true_depth_m, estimates.depth_m, estimates.depth_std_m,
    depth_m - true_depth_m AS depth_error_m,
    CASE WHEN depth_std_m > 0 THEN (depth_m - true_depth_m) / depth_std_m END AS depth_z,
    matches.true_range_m, estimates.range_m,
    matches.true_height_m, estimates.height_m, estimates.height_std_m, estimates.height_assumed,
    CASE
        WHEN height_assumed IS NOT TRUE THEN height_m - true_height_m
    END AS height_error_m,
    CASE
        WHEN height_assumed IS NOT TRUE AND height_std_m > 0
        THEN (height_m - true_height_m) / height_std_m
    END AS height_z
FROM main.estimates
JOIN main.matches USING (recording_id, observation_index)
JOIN main.recording_runs USING (recording_id, run_id);

COMMENT ON VIEW accuracy.all_errors IS 'How far is every estimate of every run from the truth? One row an estimate whose observation is matched with a true object; accuracy.errors has those of the current runs alone.';
COMMENT ON COLUMN accuracy.all_errors.class_name IS 'Class of the true object; that of the observation where the truth has none.';
COMMENT ON COLUMN accuracy.all_errors.height_error_m IS 'Estimated height less the true one; NULL where the height was assumed, not measured.';
COMMENT ON COLUMN accuracy.all_errors.height_z IS 'Height error in standard deviations; NULL where the height was assumed.';
