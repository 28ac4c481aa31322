-- Are observations that were flagged worse, and do their intervals know it?
CREATE OR REPLACE VIEW accuracy.by_quality AS
WITH judged AS (
    SELECT
        errors.method, depth_error_m, depth_z, true_depth_m, height_error_m, height_z,
        CASE
            WHEN NOT contact_visible THEN 'feet hidden'
            WHEN NOT head_visible THEN 'head hidden'
            WHEN NOT alone THEN 'not alone'
            WHEN NOT aspect_plausible THEN 'odd shape'
            ELSE 'nothing wrong'
        END AS flag,
        quality
    FROM accuracy.errors
    JOIN main.observation_quality AS q USING (recording_id, run_id, observation_index)
)
SELECT
    method, flag, count(*) AS estimate_count, stats.mean(quality) AS mean_quality,
    median(abs(depth_error_m)) AS depth_median_abs_m,
    sqrt(stats.mean(depth_error_m * depth_error_m)) AS depth_rmse_m,
    stats.mean((abs(depth_z) <= stats.normal_95())::INTEGER) AS depth_coverage_95,
    sqrt(stats.mean(height_error_m * height_error_m)) AS height_rmse_m,
    stats.mean((abs(height_z) <= stats.normal_95())::INTEGER) AS height_coverage_95
FROM judged
GROUP BY method, flag
ORDER BY method, flag;

COMMENT ON VIEW accuracy.by_quality IS 'Are flagged observations worse, and are their intervals wider by as much? By the first flag that main.observation_quality has for them.';
COMMENT ON COLUMN accuracy.by_quality.flag IS 'feet hidden, head hidden, not alone, odd shape, or nothing wrong.';
COMMENT ON COLUMN accuracy.by_quality.estimate_count IS 'Estimates with a known truth.';
COMMENT ON COLUMN accuracy.by_quality.mean_quality IS 'Mean of main.observation_quality.quality.';
