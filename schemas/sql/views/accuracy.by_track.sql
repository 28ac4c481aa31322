-- Which single objects are estimated badly?
CREATE OR REPLACE VIEW accuracy.by_track AS
FROM accuracy.metrics_by(['track'])
ORDER BY recording_id, camera, track_id, method;

COMMENT ON VIEW accuracy.by_track IS 'Which single objects are estimated badly? With one track in a row there are no intervals.';
