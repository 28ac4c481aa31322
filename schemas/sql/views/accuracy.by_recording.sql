-- Which recordings are estimated badly?
CREATE OR REPLACE VIEW accuracy.by_recording AS
SELECT
    method, recording_id, file_name,
    * EXCLUDE (
        method, run_id, run_label, recording_id, file_name, camera, class_name,
        track_id, f_number, true_depth_from_m, true_depth_to_m
    )
FROM accuracy.metrics(['recording'])
ORDER BY file_name, recording_id, method;

COMMENT ON VIEW accuracy.by_recording IS 'Which recordings are estimated badly?';
