-- Which tracks were seen in repeated frames only?
CREATE OR REPLACE VIEW main.repeated_tracks AS
WITH repeated AS (
    SELECT recording_id, camera, frame_index, TRUE AS is_repeated FROM main.repeated_frames
)
SELECT recording_id, camera, track_id
FROM main.observations
SEMI JOIN repeated USING (recording_id, camera)
LEFT JOIN repeated USING (recording_id, camera, frame_index)
GROUP BY ALL
HAVING count(*) = count(is_repeated);

COMMENT ON VIEW main.repeated_tracks IS 'Which tracks were seen only in frames that an earlier recording holds too (repeated_frames)? They are no further people. A track that goes on after such frames counts.';
