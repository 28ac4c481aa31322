-- Are the estimates of one run better than those of another, on the same observations?
--   FROM accuracy.compare_runs('before', 'after')   run ids or labels
--   FROM accuracy.compare_runs()                    each run with the one before it
-- The absolute errors of the two runs are paired by observation and method. The standard error lets
-- the differences within a track be correlated in any way and takes tracks as independent; t has
-- (tracks - 1) degrees of freedom.
CREATE OR REPLACE MACRO accuracy.compare_runs(baseline := NULL, candidate := NULL) AS TABLE
WITH runs AS (
    SELECT
        *, row_number() OVER (PARTITION BY recording_id ORDER BY started_at, run_id DESC) AS age
    FROM main.recording_runs
),
pairs AS (
    SELECT
        recording_id, a.run_id AS baseline_run_id, a.run_label AS baseline_label,
        b.run_id AS run_id, b.run_label AS run_label
    FROM runs AS a JOIN runs AS b USING (recording_id)
    WHERE a.run_id <> b.run_id
        AND CASE
            WHEN baseline IS NULL AND candidate IS NULL THEN b.age = a.age + 1
            ELSE (baseline IN (a.run_id, a.run_label) OR baseline IS NULL)
                AND (candidate IN (b.run_id, b.run_label) OR candidate IS NULL)
        END
),
errors AS NOT MATERIALIZED (
    SELECT
        recording_id, run_id, observation_index, method, camera, track_id,
        abs(depth_error_m) AS depth_m, abs(height_error_m) AS height_m
    FROM accuracy.all_errors
),
tracks AS (
    SELECT
        pairs.baseline_run_id, pairs.baseline_label, pairs.run_id, pairs.run_label,
        b.method, hash(b.recording_id, b.camera, b.track_id) AS cluster,
        [
            {
                'quantity': 'depth', 'n': count(b.depth_m - a.depth_m),
                'before': sum(a.depth_m) FILTER (b.depth_m IS NOT NULL),
                'after': sum(b.depth_m) FILTER (a.depth_m IS NOT NULL),
                'better': count(*) FILTER (b.depth_m < a.depth_m)
            },
            {
                'quantity': 'height', 'n': count(b.height_m - a.height_m),
                'before': sum(a.height_m) FILTER (b.height_m IS NOT NULL),
                'after': sum(b.height_m) FILTER (a.height_m IS NOT NULL),
                'better': count(*) FILTER (b.height_m < a.height_m)
            }
        ] AS quantities
    FROM pairs
    JOIN errors AS a
        ON a.recording_id = pairs.recording_id AND a.run_id = pairs.baseline_run_id
    JOIN errors AS b
        ON b.recording_id = pairs.recording_id AND b.run_id = pairs.run_id
        AND b.observation_index = a.observation_index AND b.method = a.method
    GROUP BY ALL
),
quantities AS (
    SELECT * EXCLUDE (quantities), unnest(quantities, recursive := TRUE) FROM tracks
),
centred AS (
    SELECT
        *, after - before - n * sum(after - before) OVER pair / sum(n) OVER pair AS deviation
    FROM quantities
    WHERE n > 0
    WINDOW pair AS (PARTITION BY baseline_run_id, run_id, method, quantity)
),
totals AS (
    SELECT
        baseline_run_id, any_value(baseline_label) AS baseline_label,
        run_id, any_value(run_label) AS run_label, method, quantity,
        sum(n)::BIGINT AS observation_count, count(*) AS track_count,
        sum(before) / sum(n) AS baseline_mae_m, sum(after) / sum(n) AS mae_m,
        sum(after - before) / sum(n) AS mae_change_m, sum(better) / sum(n) AS better_share,
        sqrt(count(*) / nullif(count(*) - 1, 0) * sum(deviation ** 2)) / sum(n) AS std_error_m
    FROM centred
    GROUP BY baseline_run_id, run_id, method, quantity
),
tested AS (
    SELECT
        *, stats.student_95(track_count - 1) * std_error_m AS half_m,
        mae_change_m / nullif(std_error_m, 0) AS t
    FROM totals
)
SELECT
    * EXCLUDE (half_m, t),
    mae_change_m - half_m AS mae_change_low_m, mae_change_m + half_m AS mae_change_high_m,
    t, stats.student_p(t, track_count - 1) AS p,
    CASE
        WHEN p IS NULL THEN NULL
        WHEN p >= 0.05 THEN 'no significant difference'
        WHEN mae_change_m < 0 THEN 'better'
        ELSE 'worse'
    END AS verdict
FROM tested
ORDER BY baseline_label, baseline_run_id, run_label, run_id, quantity, method;

COMMENT ON MACRO TABLE accuracy.compare_runs IS 'Are the estimates of one run better than those of another, on the same observations? baseline, candidate: run ids or labels; without them each run is compared with the one before it. Example: FROM accuracy.compare_runs(''before'', ''after'').';
