-- How good are the estimates, by whatever one likes to tell apart?
--   FROM accuracy.metrics(['camera', 'class'])
--   FROM accuracy.metrics(['depth'], edges := [0, 5, 10, 20, 40])
-- Every accuracy.by_* view is this macro with its dimensions filled in.
--
-- Intervals hold 95 %: Student's t with (tracks - 1) degrees of freedom on standard errors that let
-- the errors within a track be correlated in any way, and assume that tracks are independent. The
-- intervals of MAE and RMSE are made on the logarithm (delta method), so that they stay positive.
-- With one track there is nothing to judge the spread from, and they are NULL.
CREATE OR REPLACE MACRO accuracy.metrics(
    dimensions,
    edges := [0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 5, 7.5, 10, 15, 20, 30, 40, 60, 100],
    every_run := FALSE
) AS TABLE
WITH depth_bins AS (
    SELECT
        from_m,
        lead(from_m, 1, 'infinity'::DOUBLE) OVER (ORDER BY from_m) AS to_m
    FROM (SELECT unnest(edges::DOUBLE[]) AS from_m)
),
errors AS NOT MATERIALIZED (
    SELECT
        -- A dimension that is not asked for is NULL in every row, so that all rows fall together.
        {
            'method': method,
            'run_id': CASE WHEN list_contains(dimensions, 'run') THEN run_id END,
            'run_label': CASE WHEN list_contains(dimensions, 'run') THEN run_label END,
            'recording_id': CASE
                WHEN list_has_any(dimensions, ['recording', 'track']) THEN recording_id
            END,
            'file_name': CASE
                WHEN list_has_any(dimensions, ['recording', 'track']) THEN file_name
            END,
            'camera': CASE
                WHEN list_has_any(dimensions, ['camera', 'track']) THEN camera
            END,
            'class_name': CASE WHEN list_contains(dimensions, 'class') THEN class_name END,
            'track_id': CASE WHEN list_contains(dimensions, 'track') THEN track_id END,
            'f_number': CASE WHEN list_contains(dimensions, 'aperture') THEN f_number END,
            'true_depth_from_m': depth_bins.from_m,
            'true_depth_to_m': nullif(depth_bins.to_m, 'infinity'::DOUBLE)
        } AS key,
        -- One object followed over time: its frames share their errors, so they are one cluster.
        hash(recording_id, camera, track_id) AS cluster,
        true_depth_m, depth_m, depth_error_m, depth_z,
        CASE WHEN depth_z IS NOT NULL THEN depth_std_m END AS depth_std_m,
        CASE
            WHEN depth_m > 0 AND true_depth_m > 0 THEN ln(depth_m / true_depth_m)
        END AS depth_log_ratio,
        true_height_m, height_error_m, height_z,
        in_calibrated_range
    FROM accuracy.all_errors
    LEFT JOIN depth_bins
        ON list_contains(dimensions, 'depth')
        AND true_depth_m >= depth_bins.from_m AND true_depth_m < depth_bins.to_m
    WHERE (every_run OR is_current) AND (depth_error_m IS NOT NULL OR height_error_m IS NOT NULL)
),
measured AS MATERIALIZED (
    SELECT
        key,
        count(depth_error_m) AS depth_count,
        count(*) FILTER (NOT in_calibrated_range) AS out_of_range_count,
        stats.mean(depth_error_m) AS depth_bias_m,
        stats.mean(abs(depth_error_m)) AS depth_mae_m,
        median(depth_error_m) AS depth_median_error_m,
        stats.mean(depth_error_m * depth_error_m) AS depth_mse,
        stddev_samp(depth_error_m) AS depth_error_spread_m,
        quantile_cont(abs(depth_error_m), [0.5, 0.95]) AS depth_abs_quantiles,
        stats.mean(abs(depth_error_m) / nullif(true_depth_m, 0)) AS depth_abs_rel,
        stats.mean(depth_error_m * depth_error_m / nullif(true_depth_m, 0)) AS depth_sq_rel_m,
        sqrt(stats.mean(depth_log_ratio * depth_log_ratio)) AS depth_rmse_log,
        100 * stddev_pop(depth_log_ratio) AS depth_silog,
        stats.mean((abs(depth_log_ratio) < ln(1.25))::INTEGER) AS depth_delta_1,
        stats.mean((abs(depth_log_ratio) < 2 * ln(1.25))::INTEGER) AS depth_delta_2,
        stats.mean((abs(depth_log_ratio) < 3 * ln(1.25))::INTEGER) AS depth_delta_3,
        stats.known(corr(depth_m, true_depth_m)) AS depth_r,
        var_pop(true_depth_m) FILTER (depth_error_m IS NOT NULL) AS true_depth_variance,
        stats.mean((abs(depth_z) <= stats.normal_50())::INTEGER) AS depth_coverage_50,
        stats.mean((abs(depth_z) <= stats.normal_80())::INTEGER) AS depth_coverage_80,
        stats.mean((abs(depth_z) <= stats.normal_95())::INTEGER) AS depth_coverage_95,
        2 * stats.normal_95() * stats.mean(depth_std_m) AS depth_interval_width_m,
        stats.mean(depth_z * depth_z / 2 + ln(depth_std_m)) AS depth_nll,
        count(height_error_m) AS height_count,
        stats.mean(height_error_m) AS height_bias_m,
        stats.mean(abs(height_error_m)) AS height_mae_m,
        stats.mean(height_error_m * height_error_m) AS height_mse,
        100 * stats.mean(abs(height_error_m) / nullif(true_height_m, 0)) AS height_mape_percent,
        stats.mean((abs(height_z) <= stats.normal_95())::INTEGER) AS height_coverage_95
    FROM errors
    GROUP BY key
),
tracks AS (
    SELECT
        key, cluster,
        count(depth_error_m) AS depth_n,
        sum(depth_error_m) AS depth_sum,
        sum(abs(depth_error_m)) AS depth_abs,
        sum(depth_error_m * depth_error_m) AS depth_square,
        count(height_error_m) AS height_n,
        sum(height_error_m) AS height_sum,
        sum(abs(height_error_m)) AS height_abs,
        sum(height_error_m * height_error_m) AS height_square
    FROM errors
    GROUP BY key, cluster
),
-- Standard errors of means whose terms are correlated within a track (the sandwich estimator):
-- G / (G - 1) * sum over tracks of (sum of the track's deviations from the mean)^2 / n^2.
clusters AS (
    SELECT
        key,
        count(*) FILTER (depth_n > 0) AS depth_tracks,
        count(*) FILTER (height_n > 0) AS height_tracks,
        sum((depth_sum - depth_n * depth_bias_m) ** 2) AS depth_bias_ss,
        sum((depth_abs - depth_n * depth_mae_m) ** 2) AS depth_mae_ss,
        sum((depth_square - depth_n * depth_mse) ** 2) AS depth_mse_ss,
        sum((height_sum - height_n * height_bias_m) ** 2) AS height_bias_ss,
        sum((height_abs - height_n * height_mae_m) ** 2) AS height_mae_ss,
        sum((height_square - height_n * height_mse) ** 2) AS height_mse_ss
    FROM tracks JOIN measured USING (key)
    GROUP BY key
),
widths AS (
    SELECT
        *,
        depth_tracks / nullif(depth_tracks - 1, 0) AS depth_g,
        height_tracks / nullif(height_tracks - 1, 0) AS height_g,
        stats.student_95(depth_tracks - 1) AS depth_t,
        stats.student_95(height_tracks - 1) AS height_t
    FROM measured JOIN clusters USING (key)
),
intervals AS (
    SELECT
        *,
        depth_t * sqrt(depth_g * depth_bias_ss) / depth_count AS depth_bias_half_m,
        depth_t * sqrt(depth_g * depth_mae_ss) / depth_count / nullif(depth_mae_m, 0)
            AS depth_mae_log_half,
        depth_t * sqrt(depth_g * depth_mse_ss) / depth_count / 2 / nullif(depth_mse, 0)
            AS depth_rmse_log_half,
        height_t * sqrt(height_g * height_bias_ss) / height_count AS height_bias_half_m,
        height_t * sqrt(height_g * height_mae_ss) / height_count / nullif(height_mae_m, 0)
            AS height_mae_log_half,
        height_t * sqrt(height_g * height_mse_ss) / height_count / 2 / nullif(height_mse, 0)
            AS height_rmse_log_half
    FROM widths
)
SELECT
    unnest(key),
    depth_count, depth_tracks AS track_count,
    depth_bias_m,
    depth_bias_m - depth_bias_half_m AS depth_bias_low_m,
    depth_bias_m + depth_bias_half_m AS depth_bias_high_m,
    depth_mae_m,
    depth_mae_m * exp(-depth_mae_log_half) AS depth_mae_low_m,
    depth_mae_m * exp(depth_mae_log_half) AS depth_mae_high_m,
    sqrt(depth_mse) AS depth_rmse_m,
    sqrt(depth_mse) * exp(-depth_rmse_log_half) AS depth_rmse_low_m,
    sqrt(depth_mse) * exp(depth_rmse_log_half) AS depth_rmse_high_m,
    depth_median_error_m,
    depth_abs_quantiles[1] AS depth_median_abs_m,
    depth_abs_quantiles[2] AS depth_p95_m,
    depth_abs_rel, depth_sq_rel_m, depth_rmse_log, depth_silog,
    depth_delta_1, depth_delta_2, depth_delta_3,
    depth_r,
    1 - depth_mse / nullif(true_depth_variance, 0) AS depth_r2,
    depth_bias_m - stats.normal_95() * depth_error_spread_m AS depth_loa_low_m,
    depth_bias_m + stats.normal_95() * depth_error_spread_m AS depth_loa_high_m,
    depth_coverage_50, depth_coverage_80, depth_coverage_95, depth_interval_width_m,
    depth_nll + ln(2 * pi()) / 2 AS depth_nll,
    out_of_range_count,
    height_count,
    height_bias_m,
    height_bias_m - height_bias_half_m AS height_bias_low_m,
    height_bias_m + height_bias_half_m AS height_bias_high_m,
    height_mae_m,
    height_mae_m * exp(-height_mae_log_half) AS height_mae_low_m,
    height_mae_m * exp(height_mae_log_half) AS height_mae_high_m,
    sqrt(height_mse) AS height_rmse_m,
    sqrt(height_mse) * exp(-height_rmse_log_half) AS height_rmse_low_m,
    sqrt(height_mse) * exp(height_rmse_log_half) AS height_rmse_high_m,
    height_mape_percent,
    height_coverage_95
FROM intervals;

COMMENT ON MACRO TABLE accuracy.metrics IS 'How good are the estimates, by whatever one likes to tell apart? dimensions: a list of run, recording, camera, class, track, aperture, depth; edges: the borders of the depth bins in metres; every_run: TRUE for all runs, not the current ones alone. Example: FROM accuracy.metrics([''camera'', ''depth''], edges := [0, 5, 10, 20, 40]).';
