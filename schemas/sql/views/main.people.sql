-- How tall is every track, by the newest run and the best method, and what is the error made of?
CREATE OR REPLACE VIEW main.people AS
SELECT track_heights.* FROM main.track_heights
JOIN main.current_run USING (recording_id, run_id)
WHERE method = 'fused' AND height_assumed IS NOT TRUE;

COMMENT ON VIEW main.people IS 'How tall is every track, by the newest run and the best method? Its rows are what the macros height_difference and taller take: SELECT height_difference(a, b) FROM people AS a, people AS b WHERE a.track_id = 4 AND b.track_id = 7.';
