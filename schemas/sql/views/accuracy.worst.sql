-- Which estimates are the most wrong, and where is that to be seen?
CREATE OR REPLACE VIEW accuracy.worst AS
SELECT
    method, file_name, camera, frame_index, make_timestamp_ns(capture_time_ns) AS capture_time,
    track_id, object_id, depth_m, true_depth_m, depth_error_m,
    abs(depth_error_m) / true_depth_m AS relative_error,
    depth_error_m / depth_std_m AS error_in_std
FROM accuracy.errors
WHERE depth_error_m IS NOT NULL
QUALIFY row_number() OVER (PARTITION BY method ORDER BY abs(depth_error_m) / true_depth_m DESC) <= 20
ORDER BY relative_error DESC;
COMMENT ON VIEW accuracy.worst IS 'Which estimates are the most wrong, and where is that to be seen? The 20 with the largest relative depth error of each method.';
