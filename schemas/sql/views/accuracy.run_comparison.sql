-- Did the last change help: is each run better than the one before it, on the same observations?
CREATE OR REPLACE VIEW accuracy.run_comparison AS
FROM accuracy.compare_runs();

COMMENT ON VIEW accuracy.run_comparison IS 'Did the last change help: is each run better than the one before it, on the same observations? Paired absolute errors, correlated within tracks; accuracy.compare_runs(baseline, candidate) compares any two.';
COMMENT ON COLUMN accuracy.run_comparison.baseline_run_id IS 'The earlier run.';
COMMENT ON COLUMN accuracy.run_comparison.baseline_label IS 'Its label.';
COMMENT ON COLUMN accuracy.run_comparison.run_id IS 'The later run.';
COMMENT ON COLUMN accuracy.run_comparison.run_label IS 'Its label.';
COMMENT ON COLUMN accuracy.run_comparison.quantity IS 'depth or height.';
COMMENT ON COLUMN accuracy.run_comparison.observation_count IS 'Observations that both runs estimated.';
COMMENT ON COLUMN accuracy.run_comparison.baseline_mae_m IS 'Mean absolute error of the earlier run.';
COMMENT ON COLUMN accuracy.run_comparison.mae_m IS 'Mean absolute error of the later run.';
COMMENT ON COLUMN accuracy.run_comparison.mae_change_m IS 'Its change; negative is better.';
COMMENT ON COLUMN accuracy.run_comparison.better_share IS 'Share of the observations on which the later run is nearer to the truth.';
COMMENT ON COLUMN accuracy.run_comparison.std_error_m IS 'Standard error of the change, errors correlated within tracks.';
COMMENT ON COLUMN accuracy.run_comparison.mae_change_low_m IS 'Lower end of the 95 % interval of the change.';
COMMENT ON COLUMN accuracy.run_comparison.mae_change_high_m IS 'Upper end of the 95 % interval of the change.';
COMMENT ON COLUMN accuracy.run_comparison.t IS 'Change over its standard error; (tracks - 1) degrees of freedom.';
COMMENT ON COLUMN accuracy.run_comparison.p IS 'Two-sided significance of t.';
COMMENT ON COLUMN accuracy.run_comparison.verdict IS 'better, worse, or no significant difference at 5 %.';
