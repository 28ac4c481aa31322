-- Do the stated intervals hold the truth as often as they say?
CREATE OR REPLACE VIEW accuracy.coverage AS
WITH levels AS (
    FROM (VALUES (0.50, stats.normal_50()), (0.80, stats.normal_80()), (0.95, stats.normal_95()))
        AS levels(nominal, half_width)
),
quantities AS (
    SELECT
        method, hash(recording_id, camera, track_id) AS cluster,
        unnest([
            {'quantity': 'depth', 'z': depth_z, 'std_m': depth_std_m},
            {'quantity': 'height', 'z': height_z, 'std_m': height_std_m}
        ], recursive := TRUE)
    FROM accuracy.errors
),
tracks AS (
    SELECT
        method, quantity, cluster, nominal, half_width,
        count(*) AS n, count(*) FILTER (abs(z) <= half_width) AS held, sum(std_m) AS std_sum_m,
        sum(z * z / 2 + ln(std_m)) AS nll_sum
    FROM quantities CROSS JOIN levels
    WHERE z IS NOT NULL
    GROUP BY ALL
),
shares AS (
    SELECT *, sum(held) OVER level / sum(n) OVER level AS observed
    FROM tracks
    WINDOW level AS (PARTITION BY method, quantity, nominal)
),
totals AS (
    SELECT
        method, quantity, nominal, sum(n) AS estimate_count, count(*) AS track_count,
        any_value(observed) AS observed,
        stats.student_95(count(*) - 1) * sqrt(
            count(*) / nullif(count(*) - 1, 0) * sum((held - n * observed) ** 2)
        ) / sum(n) AS half,
        any_value(half_width) * 2 * sum(std_sum_m) / sum(n) AS mean_width_m,
        sum(nll_sum) / sum(n) + ln(2 * pi()) / 2 AS mean_nll
    FROM shares
    GROUP BY ALL
)
SELECT
    method, quantity, nominal::DOUBLE AS nominal, estimate_count::BIGINT AS estimate_count,
    track_count, observed,
    greatest(observed - half, 0) AS observed_low, least(observed + half, 1) AS observed_high,
    mean_width_m, mean_nll
FROM totals
ORDER BY quantity, method, nominal;

COMMENT ON VIEW accuracy.coverage IS 'Do the stated intervals hold the truth as often as they say? Nominal 50, 80 and 95 % intervals of depth and of measured height, by method.';
COMMENT ON COLUMN accuracy.coverage.quantity IS 'depth or height.';
COMMENT ON COLUMN accuracy.coverage.nominal IS 'How often the interval should hold the truth.';
COMMENT ON COLUMN accuracy.coverage.estimate_count IS 'Estimates with a standard deviation and a known truth.';
COMMENT ON COLUMN accuracy.coverage.observed IS 'How often it did.';
COMMENT ON COLUMN accuracy.coverage.observed_low IS 'Lower end of the 95 % interval of that share (Student''s t, correlated within tracks); NULL with one track.';
COMMENT ON COLUMN accuracy.coverage.observed_high IS 'Upper end of the 95 % interval of that share.';
COMMENT ON COLUMN accuracy.coverage.mean_width_m IS 'Mean width of the intervals.';
COMMENT ON COLUMN accuracy.coverage.mean_nll IS 'Mean negative log-likelihood of the truth under a normal distribution; smaller is better.';
