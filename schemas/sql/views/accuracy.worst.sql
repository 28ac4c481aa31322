-- Which estimates are the most wrong, and where is that to be seen?
CREATE OR REPLACE VIEW accuracy.worst AS
WITH errors AS NOT MATERIALIZED (
    SELECT *, abs(depth_error_m) / nullif(true_depth_m, 0) AS depth_relative_error
    FROM accuracy.errors
),
-- The twentieth largest error of each method: cheaper than ranking every estimate.
thresholds AS (
    SELECT method, list_min(max(depth_relative_error, 20)) AS threshold FROM errors GROUP BY method
),
-- Text from files stands between ' in a shell, where only ' itself has a meaning: it becomes '\''.
this_database AS (
    SELECT replace(coalesce(any_value(path), 'DB'), '''', '''\''''') AS path
    FROM duckdb_databases() WHERE database_name = current_database()
)
SELECT
    method, file_name, recording_id, camera, frame_index, capture_time_ns,
    make_timestamp_ns(capture_time_ns) AS capture_time,
    track_id, object_id, class_name, f_number,
    depth_relative_error, depth_error_m, depth_z, depth_m, depth_std_m, true_depth_m,
    height_error_m, height_m, true_height_m, in_calibrated_range, observation_index, run_id,
    concat(
        'stadimeter review --db ''', this_database.path, ''' ', recording_id,
        ' --at ', strftime(make_timestamp_ns(capture_time_ns), '%Y-%m-%dT%H:%M:%S.%nZ'),
        ' --track ', track_id,
        ' --track-camera ''', replace(camera, '''', '''\'''''), ''''
    ) AS review_command
FROM errors JOIN thresholds USING (method) CROSS JOIN this_database
WHERE depth_relative_error >= threshold
ORDER BY depth_relative_error DESC, recording_id, observation_index, method;

COMMENT ON VIEW accuracy.worst IS 'Which estimates are the most wrong, and at which moment of a recording? The twenty (more where some are equal) with the largest depth error relative to the truth of each method, with recording, frame and time, and the command that opens the timeline there.';
COMMENT ON COLUMN accuracy.worst.capture_time IS 'Capture time, UTC.';
COMMENT ON COLUMN accuracy.worst.depth_relative_error IS 'Absolute depth error over the true depth.';
COMMENT ON COLUMN accuracy.worst.review_command IS 'The command that opens the timeline at that moment, on that track; for a POSIX shell.';
