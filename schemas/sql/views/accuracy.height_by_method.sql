-- How well are heights measured, in a single frame and over a whole track?
CREATE OR REPLACE VIEW accuracy.height_by_method AS
WITH frames AS (
    SELECT
        method, 'frame' AS unit, height_count AS estimate_count, height_bias_m,
        height_bias_low_m, height_bias_high_m, height_mae_m, height_rmse_m, height_rmse_low_m,
        height_rmse_high_m, height_mape_percent, height_coverage_95
    FROM accuracy.metrics([])
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
FROM tracks
ORDER BY method, unit;

COMMENT ON VIEW accuracy.height_by_method IS 'How well are heights measured, in a single frame and over a whole track? Assumed heights do not count.';
COMMENT ON COLUMN accuracy.height_by_method.unit IS 'frame: every frame''s height by itself; track: the height of main.track_heights, one a track.';
COMMENT ON COLUMN accuracy.height_by_method.estimate_count IS 'Heights of frames, or tracks, with a known true height.';
