-- Where on the ground is everything in every frame, by the newest run and the best method?
CREATE OR REPLACE VIEW main.places AS
SELECT
    recording_id, camera, frame_index, capture_time_ns, track_id, class_name, x_m, y_m, depth_m,
    depth_std_m, camera_height_m, tilt_rad, pose_loadings
FROM main.current_estimates
JOIN main.cameras USING (recording_id, camera)
WHERE method = 'fused' AND camera_height_m IS NOT NULL;

COMMENT ON VIEW main.places IS 'Where on the ground is everything in every frame, by the newest run and the best method? Its rows are what the macro ground_distance takes: SELECT a.frame_index, ground_distance(a, b) FROM places AS a JOIN places AS b USING (recording_id, camera, frame_index) WHERE a.track_id = 4 AND b.track_id = 7.';
