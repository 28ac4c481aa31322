-- How good are the estimates, by whatever one likes to tell apart?
--   FROM accuracy.metrics(['camera', 'class'])
--   FROM accuracy.metrics(['depth'], edges := [0, 5, 10, 20, 40])
-- Every accuracy.by_* view is this macro with its dimensions filled in.
CREATE OR REPLACE MACRO accuracy.metrics(
    dimensions,
    edges := [0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 5, 7.5, 10, 15, 20, 30, 40, 60, 100],
    every_run := FALSE
) AS TABLE
-- A dimension that is not asked for is NULL in every row, so that all rows fall together.
WITH errors AS (
    SELECT
        method,
        CASE WHEN list_contains(dimensions, 'run') THEN run_id END AS run_id,
        CASE WHEN list_contains(dimensions, 'run') THEN run_label END AS run_label,
        CASE WHEN list_contains(dimensions, 'recording') THEN recording_id END AS recording_id,
        CASE WHEN list_contains(dimensions, 'recording') THEN file_name END AS file_name,
        CASE WHEN list_contains(dimensions, 'camera') THEN camera END AS camera,
        CASE WHEN list_contains(dimensions, 'class') THEN class_name END AS class_name,
        CASE WHEN list_contains(dimensions, 'track') THEN track_id END AS track_id,
        CASE WHEN list_contains(dimensions, 'aperture') THEN f_number END AS f_number,
        CASE
            WHEN list_contains(dimensions, 'depth')
            THEN list_max(list_filter(edges, lambda edge: edge <= true_depth_m))::DOUBLE
        END AS true_depth_from_m,
        CASE
            WHEN list_contains(dimensions, 'depth')
            THEN list_min(list_filter(edges, lambda edge: edge > true_depth_m))::DOUBLE
        END AS true_depth_to_m,
        -- One object followed over time: its frames share their errors, so it is one cluster.
        hash(recording_id, camera, track_id) AS cluster,
        true_depth_m, depth_m, depth_std_m, depth_error_m, abs(depth_z) AS depth_abs_z, depth_z,
        CASE
            WHEN depth_m > 0 AND true_depth_m > 0 THEN ln(depth_m / true_depth_m)
        END AS depth_log_ratio,
        true_height_m, height_error_m, abs(height_z) AS height_abs_z,
        in_calibrated_range
    FROM accuracy.all_errors
    WHERE (every_run OR is_current) AND (depth_error_m IS NOT NULL OR height_error_m IS NOT NULL)
),
tracks AS (
    SELECT
        method, run_id, run_label, recording_id, file_name, camera, class_name, track_id,
        f_number, true_depth_from_m, true_depth_to_m, cluster,
        count(depth_error_m) AS depth_n, sum(depth_error_m) AS depth_sum,
        sum(abs(depth_error_m)) AS depth_abs, sum(depth_error_m ** 2) AS depth_square,
        count(height_error_m) AS height_n, sum(height_error_m) AS height_sum,
        sum(abs(height_error_m)) AS height_abs, sum(height_error_m ** 2) AS height_square
    FROM errors
    GROUP BY ALL
),
