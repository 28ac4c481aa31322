-- Do the stated intervals hold the truth as often as they say, by rows of accuracy.sums?
CREATE OR REPLACE MACRO accuracy.coverage_from_sums(source) AS TABLE
WITH quantities AS (
    SELECT
        method, recording_id, camera, track_id,
        unnest([
            {
                'quantity': 'depth', 'n': depth_z_count, 'std_sum_m': depth_std_sum,
                'nll_sum': depth_nll_sum,
                'held': [depth_held_50_count, depth_held_80_count, depth_held_95_count]
            },
            {
                'quantity': 'height', 'n': height_z_count, 'std_sum_m': height_std_sum,
                'nll_sum': height_nll_sum,
                'held': [height_held_50_count, height_held_80_count, height_held_95_count]
            }
        ], recursive := TRUE)
    FROM query_table(source)
),
levels AS (
    SELECT
        * EXCLUDE (held), unnest(held) AS held,
        unnest([0.50, 0.80, 0.95]) AS nominal,
        unnest([stats.normal_50(), stats.normal_80(), stats.normal_95()]) AS half_width
    FROM quantities
    WHERE n > 0
),
tracks AS (
    SELECT
        method, quantity, nominal, half_width, recording_id, camera, track_id,
        sum(n) AS n, sum(held) AS held, sum(std_sum_m) AS std_sum_m, sum(nll_sum) AS nll_sum
    FROM levels
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
FROM totals;

COMMENT ON MACRO TABLE accuracy.coverage_from_sums IS 'Do the stated intervals hold the truth as often as they say, by rows of accuracy.sums that are there already? source: the name of a table, view or WITH that has them. accuracy.coverage says it of the current runs.';
