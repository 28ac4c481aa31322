-- How far is every estimate of every run from the truth?
CREATE OR REPLACE VIEW accuracy.all_errors AS
WITH truth AS (
    SELECT
        matches.recording_id, matches.observation_index, matches.camera, matches.frame_index,
        matches.object_id, matches.rule AS match_rule,
        ground_truth.class_name, ground_truth.depth_m AS true_depth_m,
        ground_truth.range_m AS true_range_m, ground_truth.height_m AS true_height_m
    FROM main.matches
    JOIN main.ground_truth USING (recording_id, camera, frame_index, object_id)
),
observed AS (
    SELECT
        truth.* REPLACE (coalesce(truth.class_name, observations.class_name) AS class_name),
        observations.track_id, frames.capture_time_ns, frames.f_number
    FROM truth
    JOIN main.observations USING (recording_id, observation_index)
    LEFT JOIN main.frames
        ON frames.recording_id = truth.recording_id
        AND frames.camera = truth.camera AND frames.frame_index = truth.frame_index
),
estimated AS (
    SELECT
        observed.*, estimates.* EXCLUDE (recording_id, observation_index, x_m, y_m),
        NOT coalesce(estimates.height_assumed, FALSE) AS height_measured
    FROM main.estimates JOIN observed USING (recording_id, observation_index)
)
SELECT
    estimated.recording_id, recordings.file_name,
    estimated.run_id, runs.label AS run_label,
    current_run.run_id IS NOT NULL AS is_current,
    camera, frame_index, capture_time_ns, observation_index, track_id,
    object_id, class_name, match_rule, method, f_number, calibration_id, in_calibrated_range,
    true_depth_m, depth_m, depth_std_m,
    depth_m - true_depth_m AS depth_error_m,
    CASE WHEN depth_std_m > 0 THEN (depth_m - true_depth_m) / depth_std_m END AS depth_z,
    true_range_m, range_m,
    true_height_m, height_m, height_std_m, height_assumed,
    CASE WHEN height_measured THEN height_m - true_height_m END AS height_error_m,
    CASE
        WHEN height_measured AND height_std_m > 0 THEN (height_m - true_height_m) / height_std_m
    END AS height_z
FROM estimated
LEFT JOIN main.recordings USING (recording_id)
LEFT JOIN main.runs ON runs.run_id = estimated.run_id
LEFT JOIN main.current_run
    ON current_run.recording_id = estimated.recording_id
    AND current_run.run_id = estimated.run_id;

COMMENT ON VIEW accuracy.all_errors IS 'How far is every estimate of every run from the truth? One row an estimate whose observation is matched with a true object; accuracy.errors has those of the current runs alone.';
COMMENT ON COLUMN accuracy.all_errors.class_name IS 'Class of the true object; that of the observation where the truth has none.';
COMMENT ON COLUMN accuracy.all_errors.height_error_m IS 'Estimated height less the true one; NULL where the height was assumed, not measured.';
COMMENT ON COLUMN accuracy.all_errors.height_z IS 'Height error in standard deviations; NULL where the height was assumed.';
