-- How far is every estimate from the truth?
CREATE OR REPLACE VIEW accuracy.errors AS
SELECT * EXCLUDE (is_current) FROM accuracy.all_errors WHERE is_current;

COMMENT ON VIEW accuracy.errors IS 'How far is every estimate from the truth? One row for each estimate of the current run of its recording whose observation is matched with a true object.';
COMMENT ON COLUMN accuracy.errors.class_name IS 'Class of the true object; that of the observation where the truth has none.';
COMMENT ON COLUMN accuracy.errors.height_error_m IS 'Estimated height less the true one; NULL where the height was assumed, not measured.';
COMMENT ON COLUMN accuracy.errors.height_z IS 'Height error in standard deviations; NULL where the height was assumed.';
