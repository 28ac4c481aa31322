-- Which kinds of objects are estimated well?
CREATE OR REPLACE VIEW accuracy.by_class AS
SELECT
    method, class_name,
    * EXCLUDE (
        method, run_id, run_label, recording_id, file_name, camera, class_name,
        track_id, f_number, true_depth_from_m, true_depth_to_m
    )
FROM accuracy.metrics(['class'])
ORDER BY class_name, method;

COMMENT ON VIEW accuracy.by_class IS 'Which kinds of objects are estimated well?';
