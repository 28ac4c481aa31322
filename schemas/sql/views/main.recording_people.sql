-- How tall is every track of each recording, by its newest run and the best method?
CREATE OR REPLACE VIEW main.recording_people AS
SELECT
    track_heights.*, recordings.file_name, tracks.class_name,
    make_timestamp_ns(tracks.first_time_ns) AS first_seen_at,
    make_timestamp_ns(tracks.last_time_ns) AS last_seen_at
FROM main.track_heights
JOIN main.current_run USING (recording_id, run_id)
JOIN main.recordings USING (recording_id)
LEFT JOIN main.tracks USING (recording_id, camera, track_id)
WHERE method = 'fused' AND height_assumed IS NOT TRUE;

COMMENT ON VIEW main.recording_people IS 'How tall is every track, by the newest run and the best method? For questions on one recording: a track in frames that another recording holds too is there as well; people has it once.';
