-- Which single objects are estimated badly?
CREATE OR REPLACE VIEW accuracy.by_track AS
SELECT
    method, recording_id, file_name, camera, track_id,
    * EXCLUDE (
        method, run_id, run_label, recording_id, file_name, camera, class_name,
        track_id, f_number, true_depth_from_m, true_depth_to_m
    )
FROM accuracy.metrics(['track'])
ORDER BY recording_id, camera, track_id, method;

COMMENT ON VIEW accuracy.by_track IS 'Which single objects are estimated badly? With one track in a row there are no intervals.';
