-- How does the error grow with distance? Bins are (0, 1], (1, 2], (2, 5], (5, 10], (10, 20], (20, 40] m and beyond.
CREATE OR REPLACE VIEW accuracy.by_range AS
WITH grouped AS (
    SELECT
        method,
        CASE
            WHEN true_depth_m <= 1 THEN 0 WHEN true_depth_m <= 2 THEN 1
            WHEN true_depth_m <= 5 THEN 2 WHEN true_depth_m <= 10 THEN 5
            WHEN true_depth_m <= 20 THEN 10 WHEN true_depth_m <= 40 THEN 20
            WHEN true_depth_m > 40 THEN 40
        END AS from_m,
        accuracy.depth_metrics(depth_m, true_depth_m) AS depth,
        accuracy.height_metrics(
            if(height_assumed, NULL, height_m), if(height_assumed, NULL, true_height_m)
        ) AS height
    FROM accuracy.errors
    GROUP BY ALL
)
SELECT * EXCLUDE (depth, height), unnest(depth), unnest(height)
FROM grouped
WHERE depth.n > 0 OR height.height_n > 0
ORDER BY ALL;
COMMENT ON VIEW accuracy.by_range IS 'How does the error grow with distance? Bins are (0, 1], (1, 2], (2, 5], (5, 10], (10, 20], (20, 40] m and beyond. Assumed heights do not count.';
