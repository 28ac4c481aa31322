-- Table 14: how closely do estimates follow the truth, and the object size the estimates?
-- 95 % intervals by Fisher's z; observations count as independent.
CREATE OR REPLACE VIEW paper.correlations AS
WITH pairs AS (
    SELECT
        measurements.camera, measurements.class_name, estimates.method,
        measurements.true_depth_m, estimates.depth_m, measurements.object_width_mm
    FROM paper.measurements
    JOIN main.estimates USING (recording_id, observation_index)
    JOIN main.current_run USING (recording_id, run_id)
    WHERE measurements.true_depth_m IS NOT NULL AND estimates.depth_m IS NOT NULL
),
correlated AS (
    SELECT
        camera, class_name, method, count(*) AS observation_count,
        min(true_depth_m) AS depth_min_m, max(true_depth_m) AS depth_max_m,
        stats.known(corr(depth_m, true_depth_m)) AS r1,
        stats.known(corr(object_width_mm, depth_m)) AS r2,
        count(object_width_mm) AS sized_count
    FROM pairs
    GROUP BY ALL
)
SELECT
    'this database' AS source, camera, class_name, method, observation_count,
    depth_min_m, depth_max_m,
    r1 AS actual_estimated_r,
    stats.fisher_low(r1, observation_count) AS actual_estimated_r_low,
    stats.fisher_high(r1, observation_count) AS actual_estimated_r_high,
    r2 AS size_estimated_r,
    stats.fisher_low(r2, sized_count) AS size_estimated_r_low,
    stats.fisher_high(r2, sized_count) AS size_estimated_r_high
FROM correlated
UNION ALL BY NAME
-- Table 14 as printed; it gives the second correlation without its sign.
SELECT
    'the paper, Table 14' AS source, camera, 'levelling staff' AS class_name,
    'aperture' AS method, n AS observation_count, 0.5 AS depth_min_m, 1.1 AS depth_max_m,
    r1::DOUBLE AS actual_estimated_r, -r2::DOUBLE AS size_estimated_r
FROM (VALUES ('Nikon D5300', 119, 0.99213, 0.86), ('Canon', 136, 0.971356, 0.92036))
    AS printed(camera, n, r1, r2);

COMMENT ON VIEW paper.correlations IS 'Table 14: how closely do estimates follow the truth, and the object size the estimates? Pearson''s r with 95 % intervals by Fisher''s z, observations taken as independent; beside the paper''s figures.';
