-- Which recordings are estimated badly?
CREATE OR REPLACE VIEW accuracy.by_recording AS
FROM accuracy.metrics_by(['recording'])
ORDER BY file_name, recording_id, method;

COMMENT ON VIEW accuracy.by_recording IS 'Which recordings are estimated badly?';
