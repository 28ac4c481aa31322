-- How does the error grow with distance?
CREATE OR REPLACE VIEW accuracy.by_range AS
FROM accuracy.metrics_by(['depth'])
ORDER BY true_depth_from_m, method;

COMMENT ON VIEW accuracy.by_range IS 'How does the error grow with distance? Bins of true depth along the axis, from true_depth_from_m up to but not including true_depth_to_m; accuracy.by_range_bins(edges) takes other edges.';
