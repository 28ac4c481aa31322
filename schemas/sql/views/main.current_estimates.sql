-- How far away and how tall is every object in every frame, by the newest run, each frame once?
CREATE OR REPLACE VIEW main.current_estimates AS
FROM main.recording_estimates
ANTI JOIN main.repeated_frames USING (recording_id, camera, frame_index);

COMMENT ON VIEW main.current_estimates IS 'How far away and how tall is every object in every frame, by every method of the newest run of its recording? Frames that several recordings hold count once (repeated_frames).';
COMMENT ON COLUMN main.current_estimates.height_low_m IS 'Lower end of the 95 % interval of the height in this frame.';
COMMENT ON COLUMN main.current_estimates.height_high_m IS 'Upper end of the 95 % interval of the height in this frame.';
