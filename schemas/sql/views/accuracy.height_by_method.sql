-- How well are heights measured, in a single frame and over a whole track?
CREATE OR REPLACE VIEW accuracy.height_by_method AS
WITH metrics AS NOT MATERIALIZED (FROM accuracy.metrics([]))
FROM accuracy.heights_from_metrics('metrics')
ORDER BY method, unit;

COMMENT ON VIEW accuracy.height_by_method IS 'How well are heights measured, in a single frame and over a whole track? Assumed heights do not count.';
COMMENT ON COLUMN accuracy.height_by_method.unit IS 'frame: every frame''s height by itself; track: the height of main.track_heights, one a track.';
COMMENT ON COLUMN accuracy.height_by_method.estimate_count IS 'Heights of frames, or tracks, with a known true height.';
