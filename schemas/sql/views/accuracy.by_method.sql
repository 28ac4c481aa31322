-- How good is each method over all matched estimates?
CREATE OR REPLACE VIEW accuracy.by_method AS
FROM accuracy.metrics_by([])
ORDER BY depth_rmse_m;

COMMENT ON VIEW accuracy.by_method IS 'How good is each method over all matched estimates?';
