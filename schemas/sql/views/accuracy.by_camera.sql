-- How good is each method on each camera?
CREATE OR REPLACE VIEW accuracy.by_camera AS
WITH grouped AS (
    SELECT
        method, camera,
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
COMMENT ON VIEW accuracy.by_camera IS 'How good is each method on each camera? Assumed heights do not count.';
