-- What did each track contribute to the accuracy of each method?
--   FROM accuracy.sums(['aperture', 'depth'])
-- One row for each method and track, split by the dimensions that are asked for: counts, sums, and
-- sums of squared deviations from the row's own mean (..._m2): all that accuracy.from_sums needs
-- to add rows up. Estimates are read once, however many groups are made of them.
CREATE OR REPLACE MACRO accuracy.sums(
    dimensions,
    edges := [0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 5, 7.5, 10, 15, 20, 30, 40, 60, 100],
    every_run := FALSE
) AS TABLE
WITH errors AS NOT MATERIALIZED (
    SELECT
        * REPLACE (
            -- A dimension that is not asked for is NULL in every row, so that rows fall together.
            accuracy.if_asked(dimensions, 'run_id', run_id) AS run_id,
            accuracy.if_asked(dimensions, 'class_name', class_name) AS class_name,
            accuracy.if_asked(dimensions, 'f_number', f_number) AS f_number,
            CASE WHEN depth_error_m IS NOT NULL THEN depth_m END AS depth_m,
            CASE WHEN depth_error_m IS NOT NULL THEN true_depth_m END AS true_depth_m,
            CASE WHEN depth_z IS NOT NULL THEN depth_std_m END AS depth_std_m,
            CASE WHEN height_z IS NOT NULL THEN height_std_m END AS height_std_m
        ),
        CASE
            WHEN depth_m > 0 AND true_depth_m > 0 THEN ln(depth_m / true_depth_m)
        END AS depth_log_ratio
    FROM accuracy.errors_in_bins(CASE WHEN list_contains(dimensions, 'depth') THEN edges END)
    WHERE (every_run OR is_current) AND (depth_error_m IS NOT NULL OR height_error_m IS NOT NULL)
),
sums AS (
    SELECT
        method, run_id, recording_id, camera, track_id, class_name, f_number,
        true_depth_from_m, true_depth_to_m,
        count(*) FILTER (NOT in_calibrated_range) AS out_of_range_count,
        count(depth_error_m) AS depth_count,
        sum(depth_error_m) AS depth_error_sum,
        sum(abs(depth_error_m)) AS depth_abs_sum,
        var_pop(depth_error_m) * count(depth_error_m) AS depth_error_m2,
        var_pop(depth_m) * count(depth_error_m) AS depth_m2,
        sum(true_depth_m) AS true_depth_sum,
        var_pop(true_depth_m) * count(depth_error_m) AS true_depth_m2,
        covar_pop(depth_m, true_depth_m) * count(depth_error_m) AS depth_cross_m2,
        list(depth_error_m) FILTER (depth_error_m IS NOT NULL) AS depth_errors_m,
        count(nullif(true_depth_m, 0)) AS depth_relative_count,
        sum(abs(depth_error_m) / nullif(true_depth_m, 0)) AS depth_abs_rel_sum,
        sum(depth_error_m * depth_error_m / nullif(true_depth_m, 0)) AS depth_sq_rel_sum,
        count(depth_log_ratio) AS depth_log_count,
        sum(depth_log_ratio) AS depth_log_sum,
        var_pop(depth_log_ratio) * count(depth_log_ratio) AS depth_log_m2,
        count_if(abs(depth_log_ratio) < ln(1.25)) AS depth_delta_1_count,
        count_if(abs(depth_log_ratio) < 2 * ln(1.25)) AS depth_delta_2_count,
        count_if(abs(depth_log_ratio) < 3 * ln(1.25)) AS depth_delta_3_count,
        count(depth_z) AS depth_z_count,
        count_if(abs(depth_z) <= stats.normal_50()) AS depth_held_50_count,
        count_if(abs(depth_z) <= stats.normal_80()) AS depth_held_80_count,
        count_if(abs(depth_z) <= stats.normal_95()) AS depth_held_95_count,
        sum(depth_std_m) AS depth_std_sum,
        sum(depth_z * depth_z / 2 + ln(depth_std_m)) AS depth_nll_sum,
        count(height_error_m) AS height_count,
        sum(height_error_m) AS height_error_sum,
        sum(abs(height_error_m)) AS height_abs_sum,
        sum(height_error_m * height_error_m) AS height_square_sum,
        count(height_error_m / nullif(true_height_m, 0)) AS height_relative_count,
        sum(abs(height_error_m) / nullif(true_height_m, 0)) AS height_abs_rel_sum,
        count(height_z) AS height_z_count,
        count_if(abs(height_z) <= stats.normal_50()) AS height_held_50_count,
        count_if(abs(height_z) <= stats.normal_80()) AS height_held_80_count,
        count_if(abs(height_z) <= stats.normal_95()) AS height_held_95_count,
        sum(height_std_m) AS height_std_sum,
        sum(height_z * height_z / 2 + ln(height_std_m)) AS height_nll_sum
    FROM errors
    GROUP BY ALL
)
-- Names come last: they are a row's, not an estimate's.
SELECT sums.*, recordings.file_name, runs.label AS run_label
FROM sums
LEFT JOIN main.recordings USING (recording_id)
LEFT JOIN main.runs ON runs.run_id = sums.run_id;

COMMENT ON MACRO TABLE accuracy.sums IS 'What did each track contribute to the accuracy of each method? One row for each method, track and value of the dimensions (run, class, aperture, depth): counts, sums and sums of squared deviations, of which accuracy.from_sums makes the metrics. edges, every_run: as in accuracy.metrics.';
