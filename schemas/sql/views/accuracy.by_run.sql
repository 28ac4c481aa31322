-- How good was each run?
CREATE OR REPLACE VIEW accuracy.by_run AS
FROM accuracy.metrics_by(['run'], every_run := TRUE)
ORDER BY run_label, run_id, method;

COMMENT ON VIEW accuracy.by_run IS 'How good was each run? accuracy.run_comparison says whether a difference between runs is significant. Unlike the other views it counts every run, not the current ones alone.';
