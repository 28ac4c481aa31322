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
    FROM main.all_runs
),
-- A name that no run has is an error, and not an answer without rows.
wrong AS (
    SELECT name FROM (SELECT unnest([baseline::VARCHAR, candidate::VARCHAR]) AS name)
    WHERE name IS NOT NULL
        AND name NOT IN (SELECT run_id FROM runs)
        AND name NOT IN (SELECT run_label FROM runs WHERE run_label IS NOT NULL)
),
names AS (
    SELECT CASE WHEN count(*) > 0 THEN error(
        'there is no run ' || string_agg(name, ' and no run ') || '; there are: '
        || coalesce(
            (SELECT string_agg(DISTINCT coalesce(run_label, run_id), ', ') FROM runs), 'none'
        )
    ) ELSE 'known' END AS state
    FROM wrong
),
pairs AS (
    SELECT
        recording_id, a.run_id AS baseline_run_id, a.run_label AS baseline_label,
        b.run_id AS run_id, b.run_label AS run_label,
        a.measured_by AS baseline_measured_by, b.measured_by AS measured_by
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
        recording_id, run_id, observation_index, method, camera, frame_index, track_id, object_id,
        abs(depth_error_m) AS depth_m, abs(height_error_m) AS height_m
    FROM accuracy.all_errors
),
-- Runs of one measurement have the same observations. Of two measurements, each of which found its
-- own, those of the same true object in the same frame are compared.
errors_anywhere AS NOT MATERIALIZED (
    FROM errors
    UNION ALL
    SELECT
        e.recording_id, e.run_id, e.observation_index, e.method, m.camera, m.frame_index,
        m.track_id, m.object_id, abs(e.depth_m - m.true_depth_m),
        CASE WHEN e.height_assumed IS NOT TRUE THEN abs(e.height_m - m.true_height_m) END
    FROM kept.estimates AS e
    JOIN kept.matches AS m USING (recording_id, measured_by, observation_index)
),
paired AS (
    SELECT pairs.*, b.method, b.camera, b.track_id, a.depth_m AS depth_before_m, b.depth_m,
        a.height_m AS height_before_m, b.height_m
    FROM pairs
    JOIN errors AS a
        ON a.recording_id = pairs.recording_id AND a.run_id = pairs.baseline_run_id
    JOIN errors AS b
        ON b.recording_id = pairs.recording_id AND b.run_id = pairs.run_id
        AND b.observation_index = a.observation_index AND b.method = a.method
    UNION ALL
    SELECT pairs.*, b.method, b.camera, b.track_id, a.depth_m, b.depth_m, a.height_m, b.height_m
    FROM (FROM pairs SEMI JOIN main.kept_runs USING (recording_id)) AS pairs
    JOIN errors_anywhere AS a
        ON a.recording_id = pairs.recording_id AND a.run_id = pairs.baseline_run_id
    JOIN errors_anywhere AS b
        ON b.recording_id = pairs.recording_id AND b.run_id = pairs.run_id
        AND b.camera = a.camera AND b.frame_index = a.frame_index AND b.object_id = a.object_id
        AND b.method = a.method
    -- Those of the current measurement are above.
    WHERE baseline_run_id IN (SELECT run_id FROM main.kept_runs)
        OR pairs.run_id IN (SELECT run_id FROM main.kept_runs)
),
tracks AS (
    SELECT
        baseline_run_id, baseline_label, run_id, run_label,
        method, hash(recording_id, camera, track_id) AS cluster,
        [
            {
                'quantity': 'depth', 'n': count(depth_m - depth_before_m),
                'before': sum(depth_before_m) FILTER (depth_m IS NOT NULL),
                'after': sum(depth_m) FILTER (depth_before_m IS NOT NULL),
                'better': count(*) FILTER (depth_m < depth_before_m)
            },
            {
                'quantity': 'height', 'n': count(height_m - height_before_m),
                'before': sum(height_before_m) FILTER (height_m IS NOT NULL),
                'after': sum(height_m) FILTER (height_before_m IS NOT NULL),
                'better': count(*) FILTER (height_m < height_before_m)
            }
        ] AS quantities
    FROM paired
    WHERE (SELECT state FROM names) = 'known'
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

COMMENT ON MACRO TABLE accuracy.compare_runs IS 'Are the estimates of one run better than those of another, on the same observations? baseline, candidate: run ids or labels; without them each run is compared with the one before it. Runs of two measurements of a recording are compared on the true objects that both found. A name that no run has is an error. Example: FROM accuracy.compare_runs(''before'', ''after'').';
