-- How tall is each tracked object, and how tall is it in truth?
CREATE OR REPLACE VIEW accuracy.track_heights AS
WITH sightings AS (
    SELECT
        recording_id, camera, track_id, object_id, any_value(class_name) AS class_name,
        count(*) AS matched_count, median(true_height_m) AS true_height_m
    FROM main.matches
    ANTI JOIN main.repeated_tracks USING (recording_id, camera, track_id)
    GROUP BY ALL
),
-- A track that changed from one object to another counts as the one that it followed longer.
followed AS (
    SELECT * FROM sightings
    QUALIFY row_number() OVER (
        PARTITION BY recording_id, camera, track_id ORDER BY matched_count DESC, object_id
    ) = 1
)
SELECT
    recording_id, recording_runs.file_name, run_id, recording_runs.run_label,
    recording_runs.is_current, camera, track_id, followed.object_id, followed.class_name,
    followed.matched_count, track_heights.method, track_heights.observation_count,
    followed.true_height_m, track_heights.height_m, track_heights.height_std_m,
    track_heights.height_m - followed.true_height_m AS height_error_m,
    CASE
        WHEN track_heights.height_std_m > 0
        THEN (track_heights.height_m - followed.true_height_m) / track_heights.height_std_m
    END AS height_z
FROM main.track_heights
JOIN followed USING (recording_id, camera, track_id)
JOIN main.recording_runs USING (recording_id, run_id)
WHERE height_assumed IS NOT TRUE AND track_heights.height_m - followed.true_height_m IS NOT NULL;

COMMENT ON VIEW accuracy.track_heights IS 'How tall is each tracked object, and how tall is it in truth? One row for each track, method and run; assumed heights are left out.';
COMMENT ON COLUMN accuracy.track_heights.matched_count IS 'Frames in which the track was matched with that object.';
COMMENT ON COLUMN accuracy.track_heights.true_height_m IS 'True height: the median over those frames.';
COMMENT ON COLUMN accuracy.track_heights.height_m IS 'Estimated height, all frames of the track taken together.';
