-- Do the stated intervals contain the truth as often as they should?
CREATE OR REPLACE VIEW accuracy.coverage AS
WITH sums AS NOT MATERIALIZED (FROM accuracy.sums([]))
FROM accuracy.coverage_from_sums('sums')
ORDER BY quantity, method, nominal;

COMMENT ON VIEW accuracy.coverage IS 'Do the stated intervals contain the truth as often as they should? Nominal 50, 80 and 95 % intervals of depth and of measured height, by method.';
COMMENT ON COLUMN accuracy.coverage.quantity IS 'depth or height.';
COMMENT ON COLUMN accuracy.coverage.nominal IS 'Share of intervals that should contain the truth.';
COMMENT ON COLUMN accuracy.coverage.estimate_count IS 'Estimates with a standard deviation and a known truth.';
COMMENT ON COLUMN accuracy.coverage.observed IS 'Share of intervals that did.';
COMMENT ON COLUMN accuracy.coverage.observed_low IS 'Lower end of the 95 % interval of that share (Student''s t, correlated within tracks); NULL with one track.';
COMMENT ON COLUMN accuracy.coverage.observed_high IS 'Upper end of the 95 % interval of that share.';
COMMENT ON COLUMN accuracy.coverage.mean_width_m IS 'Mean width of the intervals.';
COMMENT ON COLUMN accuracy.coverage.mean_nll IS 'Mean negative log-likelihood of the truth under a normal distribution; smaller is better.';
