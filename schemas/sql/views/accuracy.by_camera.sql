-- Is one camera worse than the others?
CREATE OR REPLACE VIEW accuracy.by_camera AS
SELECT
    method, camera,
    * EXCLUDE (
        method, run_id, run_label, recording_id, file_name, camera, class_name,
        track_id, f_number, true_depth_from_m, true_depth_to_m
    )
FROM accuracy.metrics(['camera'])
ORDER BY camera, method;

COMMENT ON VIEW accuracy.by_camera IS 'Is one camera worse than the others? Cameras of one name in several recordings count as one.';
