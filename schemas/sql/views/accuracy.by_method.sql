-- How good is each method over all matched estimates?
CREATE OR REPLACE VIEW accuracy.by_method AS
SELECT
    method,
    * EXCLUDE (
        method, run_id, run_label, recording_id, file_name, camera, class_name,
        track_id, f_number, true_depth_from_m, true_depth_to_m
    )
FROM accuracy.metrics([])
ORDER BY depth_rmse_m;

COMMENT ON VIEW accuracy.by_method IS 'How good is each method over all matched estimates?';
