-- How tall is every track, by the newest run and the best method, and what is the error made of?
CREATE OR REPLACE VIEW main.people AS
FROM main.recording_people
ANTI JOIN main.repeated_tracks USING (recording_id, camera, track_id);

COMMENT ON VIEW main.people IS 'How tall is every track, by the newest run and the best method? Its rows are what the macros height_difference and taller take: SELECT height_difference(a, b) FROM people AS a, people AS b WHERE a.track_id = 4 AND b.track_id = 7.';
