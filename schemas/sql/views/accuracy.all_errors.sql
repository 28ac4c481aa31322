-- How far is every estimate of every run from the truth?
CREATE OR REPLACE VIEW accuracy.all_errors AS
SELECT * EXCLUDE (true_depth_from_m, true_depth_to_m)
FROM accuracy.errors_in_bins(NULL);

COMMENT ON VIEW accuracy.all_errors IS 'How far is every estimate of every run from the truth? One row for each estimate whose observation is matched with a true object; accuracy.errors has only those of the current runs.';
COMMENT ON COLUMN accuracy.all_errors.class_name IS 'Class of the true object; that of the observation where the truth has none.';
COMMENT ON COLUMN accuracy.all_errors.height_error_m IS 'Estimated height less the true one; NULL where the height was assumed, not measured.';
COMMENT ON COLUMN accuracy.all_errors.height_z IS 'Height error in standard deviations; NULL where the height was assumed.';
