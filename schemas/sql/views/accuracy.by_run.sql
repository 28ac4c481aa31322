-- How good was each run?
CREATE OR REPLACE VIEW accuracy.by_run AS
SELECT
    method, run_id, run_label,
    * EXCLUDE (
        method, run_id, run_label, recording_id, file_name, camera, class_name,
        track_id, f_number, true_depth_from_m, true_depth_to_m
    )
FROM accuracy.metrics(['run'], every_run := TRUE)
ORDER BY run_label, run_id, method;

COMMENT ON VIEW accuracy.by_run IS 'How good was each run? accuracy.run_comparison says whether a difference between runs is significant. Unlike the other views it counts every run, not the current ones alone.';
