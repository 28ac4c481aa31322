-- Is one camera worse than the others?
CREATE OR REPLACE VIEW accuracy.by_camera AS
FROM accuracy.metrics_by(['camera'])
ORDER BY camera, method;

COMMENT ON VIEW accuracy.by_camera IS 'Is one camera worse than the others? Cameras of one name in several recordings count as one.';
