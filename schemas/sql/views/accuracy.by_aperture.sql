-- Does accuracy depend on the aperture?
CREATE OR REPLACE VIEW accuracy.by_aperture AS
SELECT
    method, f_number,
    * EXCLUDE (
        method, run_id, run_label, recording_id, file_name, camera, class_name,
        track_id, f_number, true_depth_from_m, true_depth_to_m
    )
FROM accuracy.metrics(['aperture'])
ORDER BY f_number, method;

COMMENT ON VIEW accuracy.by_aperture IS 'Does accuracy depend on the aperture? NULL: the f-number is not known.';
