-- How well are heights measured, in a single frame and over a whole track?
-- Those of frames are rows of accuracy.metrics([]) that are there already.
CREATE OR REPLACE MACRO accuracy.heights_from_metrics(source) AS TABLE
WITH frames AS (
    SELECT
        method, 'frame' AS unit, height_count AS estimate_count, height_bias_m,
        height_bias_low_m, height_bias_high_m, height_mae_m, height_rmse_m, height_rmse_low_m,
        height_rmse_high_m, height_mape_percent, height_coverage_95
    FROM query_table(source)
    WHERE height_count > 0
),
tracks AS (
    SELECT
        method, count(*) AS n, avg(height_error_m) AS bias, stddev_samp(height_error_m) AS spread,
        avg(abs(height_error_m)) AS mae, avg(height_error_m ** 2) AS mse,
        stddev_samp(height_error_m ** 2) AS mse_spread,
        100 * avg(abs(height_error_m) / nullif(true_height_m, 0)) AS mape,
        avg((abs(height_z) <= stats.normal_95())::INTEGER) AS coverage,
        stats.student_95(count(*) - 1) / sqrt(count(*)) AS t
    FROM accuracy.track_heights
    WHERE is_current
    GROUP BY method
)
FROM frames
UNION ALL
SELECT
    method, 'track', n, bias, bias - t * spread, bias + t * spread, mae, sqrt(mse),
    sqrt(mse) * exp(-t * mse_spread / 2 / nullif(mse, 0)),
    sqrt(mse) * exp(t * mse_spread / 2 / nullif(mse, 0)),
    mape, coverage
FROM tracks;

COMMENT ON MACRO TABLE accuracy.heights_from_metrics IS 'How well are heights measured, in a single frame, by rows of accuracy.metrics([]) that are there already, and over a whole track? source: the name of a table, view or WITH that has them. accuracy.height_by_method says it of the current runs.';
