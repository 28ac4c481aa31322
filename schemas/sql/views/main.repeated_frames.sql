-- Which frames does a recording that began earlier hold too?
-- Split files that overlap, and a file cut out of another, hold the same pictures: equal in camera,
-- both times, size in bytes and brightness. Of recordings that began together the longer one comes
-- first.
CREATE OR REPLACE VIEW main.repeated_frames AS
WITH ordered AS (
    SELECT
        recording_id, start_time_ns, end_time_ns,
        row_number() OVER (ORDER BY start_time_ns, end_time_ns DESC, recording_id) AS place
    FROM main.recordings
    WHERE start_time_ns IS NOT NULL
),
pairs AS (
    SELECT later.recording_id, earlier.recording_id AS first_recording_id, earlier.place
    FROM ordered AS later JOIN ordered AS earlier
        ON earlier.place < later.place AND earlier.end_time_ns >= later.start_time_ns
),
mine AS (
    FROM main.frames SEMI JOIN pairs USING (recording_id)
),
theirs AS (
    SELECT
        recording_id AS first_recording_id, camera, log_time_ns, capture_time_ns, image_bytes,
        luminance
    FROM main.frames
    WHERE recording_id IN (SELECT first_recording_id FROM pairs)
)
SELECT
    mine.recording_id, mine.camera, mine.frame_index,
    arg_min(pairs.first_recording_id, pairs.place) AS first_recording_id
FROM mine
JOIN pairs USING (recording_id)
JOIN theirs USING (first_recording_id, camera, log_time_ns, capture_time_ns, image_bytes)
WHERE theirs.luminance IS NOT DISTINCT FROM mine.luminance
GROUP BY ALL;

COMMENT ON VIEW main.repeated_frames IS 'Which frames does a recording that began earlier hold too? Those of split files that overlap, for one: equal in camera, times, bytes and brightness. The tables keep them, as a recording is kept whole; people, places, current_estimates and the views of accuracy and paper that add up frames count them once, in the recording that began first. Figures of tracking (accuracy.tracking, accuracy.detection) are of whole recordings and count them in each.';
COMMENT ON COLUMN main.repeated_frames.first_recording_id IS 'The recording in which the frame counts.';
