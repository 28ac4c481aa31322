-- How does the error grow with distance, in bins of one's own?
--   FROM accuracy.by_range_bins([0, 5, 10, 20, 40])
CREATE OR REPLACE MACRO accuracy.by_range_bins(edges) AS TABLE
FROM accuracy.metrics_by(['depth'], edges := edges)
ORDER BY true_depth_from_m, method;

COMMENT ON MACRO TABLE accuracy.by_range_bins IS 'How does the error grow with distance, in bins of one''s own? edges: the borders of the bins of true depth in metres. Example: FROM accuracy.by_range_bins([0, 5, 10, 20, 40]).';
