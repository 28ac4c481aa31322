-- How tall is every track of each recording, by its newest run and the best method?
CREATE OR REPLACE VIEW main.recording_people AS
SELECT track_heights.* FROM main.track_heights
JOIN main.current_run USING (recording_id, run_id)
WHERE method = 'fused' AND height_assumed IS NOT TRUE;

COMMENT ON VIEW main.recording_people IS 'How tall is every track, by the newest run and the best method? For questions on one recording: a track in frames that another recording holds too is there as well; people has it once.';
