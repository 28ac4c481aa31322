-- How far is every estimate of every run from the truth, and in which bin of true depth is it?
--   FROM accuracy.errors_in_bins([0, 5, 10, 20, 40])
-- Bins are joined to the truth, of which there is one row for the estimates of all methods and
-- runs. Edges that are NULL make no bins.
CREATE OR REPLACE MACRO accuracy.errors_in_bins(edges) AS TABLE
WITH depth_bins AS (
    SELECT
        from_m,
        lead(from_m, 1, 'infinity'::DOUBLE) OVER (ORDER BY from_m) AS to_m
    FROM (SELECT unnest(edges::DOUBLE[]) AS from_m)
),
truth AS (
    SELECT
        matches.*, from_m AS true_depth_from_m,
        nullif(to_m, 'infinity'::DOUBLE) AS true_depth_to_m
    FROM main.matches
    ANTI JOIN main.repeated_frames USING (recording_id, camera, frame_index)
    LEFT JOIN depth_bins
        ON edges IS NOT NULL AND true_depth_m >= from_m AND true_depth_m < to_m
)
SELECT
    recording_id, recording_runs.file_name, run_id, recording_runs.run_label,
    recording_runs.is_current,
    truth.camera, truth.frame_index, truth.capture_time_ns, observation_index,
    truth.track_id, truth.object_id, truth.class_name, truth.rule AS match_rule,
    estimates.method, truth.f_number, estimates.calibration_id, estimates.in_calibrated_range,
    truth.true_depth_m, estimates.depth_m, estimates.depth_std_m,
    depth_m - true_depth_m AS depth_error_m,
    CASE WHEN depth_std_m > 0 THEN (depth_m - true_depth_m) / depth_std_m END AS depth_z,
    truth.true_range_m, estimates.range_m,
    truth.true_height_m, estimates.height_m, estimates.height_std_m, estimates.height_assumed,
    CASE
        WHEN height_assumed IS NOT TRUE THEN height_m - true_height_m
    END AS height_error_m,
    CASE
        WHEN height_assumed IS NOT TRUE AND height_std_m > 0
        THEN (height_m - true_height_m) / height_std_m
    END AS height_z,
    true_depth_from_m, true_depth_to_m
FROM main.estimates
JOIN truth USING (recording_id, observation_index)
JOIN main.recording_runs USING (recording_id, run_id);

COMMENT ON MACRO TABLE accuracy.errors_in_bins IS 'How far is every estimate of every run from the truth, and in which bin of true depth is it? edges: the borders of the bins of true depth in metres. Example: FROM accuracy.errors_in_bins([0, 5, 10, 20, 40]).';
