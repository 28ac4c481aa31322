-- How good are the estimates, by rows of accuracy.sums that are there already?
--   WITH sums AS MATERIALIZED (FROM accuracy.sums(['class', 'depth']))
--   FROM accuracy.from_sums('sums', ['class']) UNION ALL FROM accuracy.from_sums('sums', ['depth'])
--
-- Intervals hold 95 %: Student's t with (tracks - 1) degrees of freedom on standard errors that let
-- the errors within a track be correlated in any way, and assume that tracks are independent. The
-- intervals of MAE and RMSE are made on the logarithm (delta method), so that they stay positive.
-- With one track there is nothing to judge the spread from, and they are NULL.
CREATE OR REPLACE MACRO accuracy.from_sums(source, dimensions) AS TABLE
WITH keyed AS NOT MATERIALIZED (
    SELECT
        -- A dimension that is not asked for is NULL in every row, so that all rows fall together.
        {
            'method': method,
            'run_id': accuracy.if_asked(dimensions, 'run_id', run_id),
            'run_label': accuracy.if_asked(dimensions, 'run_label', run_label),
            'recording_id': accuracy.if_asked(dimensions, 'recording_id', recording_id),
            'file_name': accuracy.if_asked(dimensions, 'file_name', file_name),
            'camera': accuracy.if_asked(dimensions, 'camera', camera),
            'class_name': accuracy.if_asked(dimensions, 'class_name', class_name),
            'track_id': accuracy.if_asked(dimensions, 'track_id', track_id),
            'f_number': accuracy.if_asked(dimensions, 'f_number', f_number),
            'true_depth_from_m':
                accuracy.if_asked(dimensions, 'true_depth_from_m', true_depth_from_m),
            'true_depth_to_m': accuracy.if_asked(dimensions, 'true_depth_to_m', true_depth_to_m)
        } AS key,
        -- One object followed over time: its frames share their errors, so they are one cluster.
        hash(recording_id, camera, track_id) AS cluster,
        -- What follows from the sums that there are.
        true_depth_sum + depth_error_sum AS depth_sum,
        depth_error_m2 + depth_error_sum * depth_error_sum / nullif(depth_count, 0)
            AS depth_square_sum,
        COLUMNS(lambda name: name <> 'method' AND accuracy.dimensions_of(name) IS NULL)
    FROM query_table(source)
),
-- Groups are known by the hash of their key: the key itself, mostly texts, is slow to compare.
parts AS NOT MATERIALIZED (SELECT hash(key) AS id, * FROM keyed),
totals AS MATERIALIZED (
    SELECT
        id, any_value(key) AS key,
        sum(depth_count)::BIGINT AS depth_count,
        sum(out_of_range_count)::BIGINT AS out_of_range_count,
        sum(depth_error_sum) / nullif(sum(depth_count), 0) AS depth_bias_m,
        sum(depth_abs_sum) / nullif(sum(depth_count), 0) AS depth_mae_m,
        sum(depth_square_sum) / nullif(sum(depth_count), 0) AS depth_mse,
        sum(depth_sum) / nullif(sum(depth_count), 0) AS depth_mean_m,
        sum(true_depth_sum) / nullif(sum(depth_count), 0) AS true_depth_mean_m,
        sum(depth_abs_rel_sum) / nullif(sum(depth_relative_count), 0) AS depth_abs_rel,
        sum(depth_sq_rel_sum) / nullif(sum(depth_relative_count), 0) AS depth_sq_rel_m,
        sum(depth_log_count) AS depth_log_count,
        sum(depth_log_sum) / nullif(sum(depth_log_count), 0) AS depth_log_mean,
        sum(depth_delta_1_count) / nullif(sum(depth_log_count), 0) AS depth_delta_1,
        sum(depth_delta_2_count) / nullif(sum(depth_log_count), 0) AS depth_delta_2,
        sum(depth_delta_3_count) / nullif(sum(depth_log_count), 0) AS depth_delta_3,
        sum(depth_held_50_count) / nullif(sum(depth_z_count), 0) AS depth_coverage_50,
        sum(depth_held_80_count) / nullif(sum(depth_z_count), 0) AS depth_coverage_80,
        sum(depth_held_95_count) / nullif(sum(depth_z_count), 0) AS depth_coverage_95,
        2 * stats.normal_95() * sum(depth_std_sum) / nullif(sum(depth_z_count), 0)
            AS depth_interval_width_m,
        sum(depth_nll_sum) / nullif(sum(depth_z_count), 0) + ln(2 * pi()) / 2 AS depth_nll,
        sum(height_count)::BIGINT AS height_count,
        sum(height_error_sum) / nullif(sum(height_count), 0) AS height_bias_m,
        sum(height_abs_sum) / nullif(sum(height_count), 0) AS height_mae_m,
        sum(height_square_sum) / nullif(sum(height_count), 0) AS height_mse,
        100 * sum(height_abs_rel_sum) / nullif(sum(height_relative_count), 0)
            AS height_mape_percent,
        sum(height_held_95_count) / nullif(sum(height_z_count), 0) AS height_coverage_95
    FROM parts
    GROUP BY id
),
-- Sums of squared deviations about the mean of all: those about each row's mean, and those of the
-- rows' means (Chan, Golub and LeVeque 1979).
spreads AS (
    SELECT
        id,
        sum(depth_error_m2 + depth_parts.depth_count * (
            depth_error_sum / depth_parts.depth_count - depth_bias_m
        ) ** 2) AS depth_error_m2,
        sum(depth_m2 + depth_parts.depth_count * (
            depth_sum / depth_parts.depth_count - depth_mean_m
        ) ** 2) AS depth_m2,
        sum(true_depth_m2 + depth_parts.depth_count * (
            true_depth_sum / depth_parts.depth_count - true_depth_mean_m
        ) ** 2) AS true_depth_m2,
        sum(depth_cross_m2 + depth_parts.depth_count
            * (depth_sum / depth_parts.depth_count - depth_mean_m)
            * (true_depth_sum / depth_parts.depth_count - true_depth_mean_m)
        ) AS depth_cross_m2,
        sum(depth_log_m2 + depth_parts.depth_log_count * (
            depth_log_sum / nullif(depth_parts.depth_log_count, 0) - depth_log_mean
        ) ** 2) AS depth_log_m2
    FROM (FROM parts WHERE depth_count > 0) AS depth_parts JOIN totals USING (id)
    GROUP BY id
),
quantiles AS (
    SELECT
        id, median(depth_error_m) AS depth_median_error_m,
        quantile_cont(abs(depth_error_m), [0.5, 0.95]) AS depth_abs_quantiles
    FROM (SELECT id, unnest(depth_errors_m) AS depth_error_m FROM parts)
    GROUP BY id
),
tracks AS (
    SELECT
        id, cluster,
        sum(depth_count) AS depth_n,
        sum(depth_error_sum) AS depth_sum,
        sum(depth_abs_sum) AS depth_abs,
        sum(depth_square_sum) AS depth_square,
        sum(height_count) AS height_n,
        sum(height_error_sum) AS height_sum,
        sum(height_abs_sum) AS height_abs,
        sum(height_square_sum) AS height_square
    FROM parts
    GROUP BY id, cluster
),
-- Standard errors of means whose terms are correlated within a track (the sandwich estimator):
-- G / (G - 1) * sum over tracks of (sum of the track's deviations from the mean)^2 / n^2.
clusters AS (
    SELECT
        id,
        count(*) FILTER (depth_n > 0) AS depth_tracks,
        count(*) FILTER (height_n > 0) AS height_tracks,
        sum((depth_sum - depth_n * depth_bias_m) ** 2) AS depth_bias_ss,
        sum((depth_abs - depth_n * depth_mae_m) ** 2) AS depth_mae_ss,
        sum((depth_square - depth_n * depth_mse) ** 2) AS depth_mse_ss,
        sum((height_sum - height_n * height_bias_m) ** 2) AS height_bias_ss,
        sum((height_abs - height_n * height_mae_m) ** 2) AS height_mae_ss,
        sum((height_square - height_n * height_mse) ** 2) AS height_mse_ss
    FROM tracks JOIN totals USING (id)
    GROUP BY id
),
widths AS (
    SELECT
        *,
        depth_tracks / nullif(depth_tracks - 1, 0) AS depth_g,
        height_tracks / nullif(height_tracks - 1, 0) AS height_g,
        stats.student_95(depth_tracks - 1) AS depth_t,
        stats.student_95(height_tracks - 1) AS height_t
    FROM totals
    JOIN clusters USING (id)
    LEFT JOIN spreads USING (id)
    LEFT JOIN quantiles USING (id)
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
    depth_abs_rel, depth_sq_rel_m,
    sqrt(depth_log_m2 / depth_log_count + depth_log_mean ** 2) AS depth_rmse_log,
    100 * sqrt(depth_log_m2 / depth_log_count) AS depth_silog,
    depth_delta_1, depth_delta_2, depth_delta_3,
    CASE
        WHEN stats.varies(depth_m2 / depth_count, depth_mean_m)
            AND stats.varies(true_depth_m2 / depth_count, true_depth_mean_m)
        THEN stats.known(depth_cross_m2 / (sqrt(depth_m2) * sqrt(true_depth_m2)))
    END AS depth_r,
    CASE
        WHEN stats.varies(true_depth_m2 / depth_count, true_depth_mean_m)
        THEN 1 - depth_mse / (true_depth_m2 / depth_count)
    END AS depth_r2,
    depth_bias_m
        - stats.normal_95() * sqrt(depth_error_m2 / nullif(depth_count - 1, 0)) AS depth_loa_low_m,
    depth_bias_m
        + stats.normal_95() * sqrt(depth_error_m2 / nullif(depth_count - 1, 0)) AS depth_loa_high_m,
    depth_coverage_50, depth_coverage_80, depth_coverage_95, depth_interval_width_m,
    depth_nll,
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

COMMENT ON MACRO TABLE accuracy.from_sums IS 'How good are the estimates, by rows of accuracy.sums that are there already? source: the name of a table, view or WITH that has them; dimensions: as in accuracy.metrics, those of the rows or fewer.';
